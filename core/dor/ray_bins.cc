#include "core/dor/ray_bins.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

namespace mapkeep {
namespace {

constexpr double kRaysABin = 2;
constexpr int kMaxBinsAround = 8192;
constexpr int kMaxBinsUp = 4096;
constexpr float kRoundingUp = 1.00001F;  // a bin's reach is a float and must not be too short

// A stand-in for the azimuth, [0, 4) around: the way along a diamond. Rises with the angle, at most by 1 a radian.
double DiamondAngle(double x, double y) {
  const double sum = std::abs(x) + std::abs(y);
  if (sum == 0) return 0;
  return y >= 0 ? 1 - x / sum : 3 + x / sum;
}

// Of the elevation, at a level distance and a height.
double Sine(double flat, double height) {
  const double length = std::sqrt(flat * flat + height * height);
  return length == 0 ? 0 : height / length;
}

// std::floor is a call without SSE 4.1, and this is asked four times a voxel.
int Floor(double value) {
  const int truncated = static_cast<int>(value);
  return truncated - (value < truncated ? 1 : 0);
}

// An upper bound of asin(ratio), for ratio up to kWide.
constexpr double kWide = 0.7;
constexpr double kRounding = 1e-5;  // of directions kept as floats
double AngleBound(double ratio) { return 1.12 * ratio + kRounding; }

}  // namespace

int RayBins::BinV(double sine) const { return std::clamp(Floor((sine - sine_low_) * v_scale_), 0, bins_v_ - 1); }

void RayBins::Build(std::span<const Eigen::Vector3d> to_ends, double share) {
  // How much of the sphere the scan covers, to have about the same number of rays in a bin for every sensor.
  float low = 1, high = -1;
  uint64_t sectors = 0;  // 64 around
  directions_.resize(to_ends.size());
  for (size_t i = 0; i < to_ends.size(); ++i) {
    const double length = to_ends[i].norm();
    // Floats are off by less than the slack that windows have.
    Direction& direction = directions_[i];
    direction.diamond = static_cast<float>(DiamondAngle(to_ends[i].x(), to_ends[i].y()));
    direction.sine = static_cast<float>(length == 0 ? 0 : to_ends[i].z() / length);
    direction.length = static_cast<float>(length);
    low = std::min(low, direction.sine);
    high = std::max(high, direction.sine);
    sectors |= uint64_t{1} << (static_cast<int>(16 * direction.diamond) & 63);
  }
  const double height = std::max<double>(high - low, 1e-3);
  const double width = 2 * std::numbers::pi * std::popcount(sectors) / 64;
  const double bins = std::max(1.0, static_cast<double>(to_ends.size()) / kRaysABin);
  const double edge = std::sqrt(width * height / bins);
  const auto around = static_cast<uint32_t>(std::clamp(2 * std::numbers::pi / edge, 16.0, 0.5 * kMaxBinsAround));
  bins_u_ = static_cast<int>(std::bit_ceil(around));
  bins_v_ = static_cast<int>(std::clamp(height / edge, 1.0, double{kMaxBinsUp}));
  sine_low_ = low;
  sine_high_ = high;
  v_scale_ = bins_v_ / height;
  u_scale_ = bins_u_ / 4.0;

  const size_t count = static_cast<size_t>(bins_u_) * bins_v_;
  levels_.resize(std::max<size_t>(kCoarse + 1, std::bit_width(static_cast<uint32_t>(std::max(bins_u_, bins_v_)))));
  for (size_t level = 0; level < levels_.size(); ++level) {
    levels_[level].u_mask = std::max(1, bins_u_ >> level) - 1;
    levels_[level].v_count = ((bins_v_ - 1) >> level) + 1;
    levels_[level].reach.assign(static_cast<size_t>(levels_[level].u_mask + 1) * levels_[level].v_count, 0);
  }
  bin_of_.resize(to_ends.size());
  starts_.assign(count + 1, 0);
  for (size_t i = 0; i < to_ends.size(); ++i) {
    const int u = static_cast<int>(directions_[i].diamond * u_scale_) & (bins_u_ - 1);
    const uint32_t bin = static_cast<uint32_t>(BinV(directions_[i].sine)) * bins_u_ + u;
    bin_of_[i] = bin;
    ++starts_[bin + 1];
    float& reach = levels_[0].reach[bin];
    reach = std::max(reach, kRoundingUp * static_cast<float>(share) * directions_[i].length);
  }
  for (size_t bin = 0; bin < count; ++bin) starts_[bin + 1] += starts_[bin];
  rays_.resize(to_ends.size(), Ray(Eigen::Vector3d::Zero()));
  // Filling moves each start to the next bin's; so they are filled from the end backwards, which leaves them right.
  for (size_t i = to_ends.size(); i-- > 0;) rays_[--starts_[bin_of_[i] + 1]] = Ray(to_ends[i]);
  for (size_t bin = 0; bin < count; ++bin) starts_[bin] = starts_[bin + 1];
  starts_[count] = static_cast<uint32_t>(to_ends.size());

  for (size_t level = 1; level < levels_.size(); ++level) {
    const Level& below = levels_[level - 1];
    Level& here = levels_[level];
    const int halving_u = below.u_mask == here.u_mask ? 0 : 1;
    for (int v = 0; v < below.v_count; ++v) {
      const size_t row = static_cast<size_t>(v) * (below.u_mask + 1);
      const size_t to = static_cast<size_t>(v >> 1) * (here.u_mask + 1);
      for (int u = 0; u <= below.u_mask; ++u) {
        float& reach = here.reach[to + (u >> halving_u)];
        reach = std::max(reach, below.reach[row + u]);
      }
    }
  }
}

RayBins::Window RayBins::WindowOf(const Region& region) const {
  Window window;
  const Eigen::Vector3d& centre = region.centre;
  const double flat = std::sqrt(centre.x() * centre.x() + centre.y() * centre.y());
  const double nearest = std::max(0.0, flat - region.radius), farthest = flat + region.radius;
  if (region.radius > kWide * flat) {
    window.u1 = bins_u_ - 1;
  } else {
    const double u = DiamondAngle(centre.x(), centre.y());
    const double half = AngleBound(region.radius / flat);
    window.u0 = Floor((u - half) * u_scale_);
    window.u1 = Floor((u + half) * u_scale_);
  }
  // The steepest and the flattest direction into the region lie in its corners.
  const double low = centre.z() - region.half_height, high = centre.z() + region.half_height;
  const double sine_low = Sine(low > 0 ? farthest : nearest, low) - kRounding;
  const double sine_high = Sine(high > 0 ? nearest : farthest, high) + kRounding;
  window.v0 = BinV(sine_low);
  window.v1 = BinV(sine_high);
  const double rise = std::max({0.0, low, -high});
  window.distance = static_cast<float>(std::sqrt(nearest * nearest + rise * rise));
  // Directions that no ray of the scan has.
  if (sine_high < sine_low_ || sine_low > sine_high_) window.distance = std::numeric_limits<float>::infinity();
  return window;
}

bool RayBins::Reaches(const Window& window) const {
  const auto extent = static_cast<uint32_t>(std::max(window.u1 - window.u0, window.v1 - window.v0));
  const size_t level = std::min(levels_.size() - 1, static_cast<size_t>(std::bit_width(extent)));
  const Level& cells = levels_[level];
  // At most 2 x 2 cells, but for the top level, which is small.
  const int shift = static_cast<int>(level);
  const int u0 = window.u0 >> shift, u1 = std::min(window.u1 >> shift, u0 + cells.u_mask);
  for (int v = window.v0 >> shift; v <= std::min(window.v1 >> shift, cells.v_count - 1); ++v) {
    for (int u = u0; u <= u1; ++u) {
      if (cells.reach[static_cast<size_t>(v) * (cells.u_mask + 1) + (u & cells.u_mask)] >= window.distance) return true;
    }
  }
  return false;
}

}  // namespace mapkeep
