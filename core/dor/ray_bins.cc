#include "core/dor/ray_bins.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

// This file is compiled with options that let the compiler work on several lanes at once (CMakeLists.txt); its numbers
// are all finite, so that they change no bit. The hot functions exist twice, with and without AVX2; lanes do the same
// arithmetic in either, so that every processor finds the same.
#define MAPKEEP_INLINE_MEMBER [[gnu::always_inline]] inline
#define MAPKEEP_INLINE MAPKEEP_INLINE_MEMBER static
#if defined(__x86_64__)
#define MAPKEEP_AVX2 [[gnu::target("avx2,bmi,bmi2,lzcnt,popcnt")]]
#else
#define MAPKEEP_AVX2
#endif

namespace mapkeep {
namespace {

constexpr double kRaysABin = 2;
constexpr int kMaxBinsAround = 8192;
constexpr int kMaxBinsUp = 4096;
constexpr float kRoundingUp = 1.00001F;  // a bin's reach must not be too short
constexpr float kNever = std::numeric_limits<float>::max();
constexpr float kTiny = 1e-20F;
constexpr size_t kLanes = RayTargets::kLanes;
constexpr int kCoarse = 2;  // the level of cells in which wide windows are gone through
constexpr int kCoarseBins = 1 << kCoarse;
constexpr int kClearRows = 2;  // one row of rays may pass above or below what is there

// By value and without branches, as lanes need it.
MAPKEEP_INLINE float Lower(float a, float b) { return a < b ? a : b; }
MAPKEEP_INLINE float Higher(float a, float b) { return a > b ? a : b; }
MAPKEEP_INLINE int32_t Lower(int32_t a, int32_t b) { return a < b ? a : b; }
MAPKEEP_INLINE int32_t Higher(int32_t a, int32_t b) { return a > b ? a : b; }

// An upper bound of asin(ratio), for ratio up to kWide.
constexpr float kWide = 0.7F;
constexpr float kRounding = 2e-5F;  // of directions as floats
MAPKEEP_INLINE float AngleBound(float ratio) { return 1.12F * ratio + kRounding; }

// std::floor is a call without SSE 4.1.
MAPKEEP_INLINE int32_t Floor(float value) {
  const auto truncated = static_cast<int32_t>(value);
  return truncated - (value < static_cast<float>(truncated) ? 1 : 0);
}

// A stand-in for the azimuth, [0, 4) around: the way along a diamond. Rises with the angle, at most by 1 a radian.
MAPKEEP_INLINE float DiamondAngle(float x, float y) {
  const float share = x / Higher(std::abs(x) + std::abs(y), kTiny);
  const float ahead = 1 - share, back = 3 + share;
  return y >= 0 ? ahead : back;
}

// Of the elevation, at a level distance and a height.
MAPKEEP_INLINE float Sine(float flat, float height) {
  return height / Higher(std::sqrt(flat * flat + height * height), kTiny);
}

// Bins of directions, both ends included; u may leave [0, bins around) and wraps. And the nearest distance to look for,
// kNever where no ray leads.
struct Window {
  int32_t u0, u1, v0, v1;
  float distance;
};

struct Windows {
  alignas(32) int32_t u0[kLanes];
  alignas(32) int32_t u1[kLanes];
  alignas(32) int32_t v0[kLanes];
  alignas(32) int32_t v1[kLanes];
  alignas(32) float distance[kLanes];

  MAPKEEP_INLINE_MEMBER void Set(size_t lane, const Window& window) {
    u0[lane] = window.u0;
    u1[lane] = window.u1;
    v0[lane] = window.v0;
    v1[lane] = window.v1;
    distance[lane] = window.distance;
  }
  MAPKEEP_INLINE_MEMBER Window At(size_t lane) const {
    return {u0[lane], u1[lane], v0[lane], v1[lane], distance[lane]};
  }
};

template <typename Layout>
MAPKEEP_INLINE int32_t BinV(const Layout& layout, float sine) {
  return Lower(Higher(Floor((sine - layout.sine_low) * layout.v_scale), 0), layout.bins_v - 1);
}

template <typename Layout>
MAPKEEP_INLINE Window WindowOf(const Layout& layout, float x, float y, float z, float radius, float half_height) {
  Window window;
  const float flat = std::sqrt(x * x + y * y);
  const float nearest = Higher(0.0F, flat - radius), farthest = flat + radius;
  // Half a turn to either side where the region is wide or all around.
  const float ratio = radius / Higher(flat, kTiny), bound = AngleBound(ratio);
  const float half = ratio > kWide ? 2.0F : bound;
  const float u = DiamondAngle(x, y);
  window.u0 = Floor((u - half) * layout.u_scale);
  window.u1 = Floor((u + half) * layout.u_scale);
  // The steepest and the flattest direction into the region lie in its corners.
  const float low = z - half_height, high = z + half_height;
  const float flat_low = low > 0 ? farthest : nearest, flat_high = high > 0 ? nearest : farthest;
  const float sine_low = Sine(flat_low, low) - kRounding;
  const float sine_high = Sine(flat_high, high) + kRounding;
  window.v0 = BinV(layout, sine_low);
  window.v1 = BinV(layout, sine_high);
  const float rise = Higher(0.0F, Higher(low, -high));
  const float distance = std::sqrt(nearest * nearest + rise * rise);
  // Directions that no ray of the scan has.
  const bool outside = (sine_high < layout.sine_low) | (sine_low > layout.sine_high);
  window.distance = outside ? kNever : distance;
  return window;
}

// Which of eight rays pass a target, and between which times.
struct Passing {
  alignas(32) float enter[kLanes];
  alignas(32) float leave[kLanes];
  alignas(32) int32_t passes[kLanes];
  int32_t any;
};

struct Target {
  float low[3], high[3];
};

MAPKEEP_INLINE void Pass(const float* __restrict ix, const float* __restrict iy, const float* __restrict iz,
                         const Target& target, float end, Passing& passing) {
  for (size_t k = 0; k < kLanes; ++k) {
    const float ax = target.low[0] * ix[k], bx = target.high[0] * ix[k];
    const float ay = target.low[1] * iy[k], by = target.high[1] * iy[k];
    const float az = target.low[2] * iz[k], bz = target.high[2] * iz[k];
    const float enter = std::max(std::max(0.0F, std::min(ax, bx)), std::max(std::min(ay, by), std::min(az, bz)));
    const float leave = std::min(std::min(end, std::max(ax, bx)), std::min(std::max(ay, by), std::max(az, bz)));
    passing.enter[k] = enter;
    passing.leave[k] = leave;
    passing.passes[k] = (enter < leave) & (leave < end) ? -1 : 0;
  }
  int32_t any = 0;
  for (size_t k = 0; k < kLanes; ++k) any |= passing.passes[k];
  passing.any = any;
}

}  // namespace

// The hot functions, to be inlined into one variant for every kind of processor.
struct RayBins::Kernels {
  MAPKEEP_INLINE void Directions(const float* __restrict x, const float* __restrict y, const float* __restrict z,
                                 size_t count, float* __restrict diamond, float* __restrict sine,
                                 float* __restrict length) {
    for (size_t i = 0; i < count; ++i) {
      const float norm = std::sqrt(x[i] * x[i] + y[i] * y[i] + z[i] * z[i]);
      diamond[i] = DiamondAngle(x[i], y[i]);
      sine[i] = z[i] / Higher(norm, kTiny);
      length[i] = norm;
    }
  }

  MAPKEEP_INLINE void BinsOf(const Layout& layout, const float* __restrict diamond, const float* __restrict sine,
                             size_t count, uint32_t* __restrict bins) {
    const Layout own = layout;
    for (size_t i = 0; i < count; ++i) {
      const int32_t u = static_cast<int32_t>(diamond[i] * own.u_scale) & (own.bins_u - 1);
      bins[i] = static_cast<uint32_t>(BinV(own, sine[i]) * own.bins_u + u);
    }
  }

  MAPKEEP_INLINE void Inverses(const float* __restrict along, size_t count, float* __restrict inverse) {
    for (size_t i = 0; i < count; ++i) {
      const float inverted = 1 / along[i];
      inverse[i] = along[i] == 0 ? 1e30F : inverted;
    }
  }

  MAPKEEP_INLINE void WindowsOf(const Layout& layout, const RayTargets::Group& targets, Windows& windows) {
    for (size_t i = 0; i < kLanes; ++i) {
      const float dx = 0.5F * (targets.high[0][i] - targets.low[0][i]);
      const float dy = 0.5F * (targets.high[1][i] - targets.low[1][i]);
      const float dz = 0.5F * (targets.high[2][i] - targets.low[2][i]);
      windows.Set(i, WindowOf(layout, targets.low[0][i] + dx, targets.low[1][i] + dy, targets.low[2][i] + dz,
                              std::sqrt(dx * dx + dy * dy) * kRoundingUp, dz * kRoundingUp));
    }
  }

  // Of the surroundings of the targets' voxels; the distance is what every ray must be longer than.
  MAPKEEP_INLINE void WindowsAround(const Layout& layout, const RayTargets::Group& targets, const Clearance& clearance,
                                    Windows& windows) {
    const float half = 0.5F + clearance.around, behind = 0.87F + clearance.behind;
    for (size_t i = 0; i < kLanes; ++i) {
      const float x = targets.corner[0][i] + 0.5F, y = targets.corner[1][i] + 0.5F, z = targets.corner[2][i] + 0.5F;
      Window window = WindowOf(layout, x, y, z, half, half);
      const float far = std::sqrt(x * x + y * y + z * z) + behind;
      window.distance = Higher(window.distance, far);  // never stays never
      windows.Set(i, window);
    }
  }

  MAPKEEP_INLINE bool Reaches(const RayBins& bins, const Window& window) {
    const auto extent = static_cast<uint32_t>(std::max(window.u1 - window.u0, window.v1 - window.v0));
    const size_t level = std::min(bins.levels_.size() - 1, static_cast<size_t>(std::bit_width(extent)));
    const Level& cells = bins.levels_[level];
    // At most 2 x 2 cells, but for the top level, which is small.
    const int shift = static_cast<int>(level);
    const int u0 = window.u0 >> shift, u1 = std::min(window.u1 >> shift, u0 + cells.u_mask);
    for (int v = window.v0 >> shift; v <= std::min(window.v1 >> shift, cells.v_count - 1); ++v) {
      const float* row = cells.reach.data() + static_cast<size_t>(v) * (cells.u_mask + 1);
      for (int u = u0; u <= u1; ++u) {
        if (row[u & cells.u_mask] >= window.distance) return true;
      }
    }
    return false;
  }

  // How many rows of cells with rays a window has, if none of the rays is too short; 0 if one is. Cells no larger than
  // a quarter of the window: they cover little beside it.
  MAPKEEP_INLINE int ClearRows(const RayBins& bins, const Window& window) {
    const auto extent = static_cast<uint32_t>(std::max(window.u1 - window.u0, window.v1 - window.v0));
    const size_t level = std::min(bins.levels_.size() - 1,
                                  static_cast<size_t>(std::max(0, static_cast<int>(std::bit_width(extent)) - 2)));
    const Level& cells = bins.levels_[level];
    const int shift = static_cast<int>(level);
    const int u0 = window.u0 >> shift, u1 = std::min(window.u1 >> shift, u0 + cells.u_mask);
    const int v0 = window.v0 >> shift, v1 = std::min(window.v1 >> shift, cells.v_count - 1);
    int rows = 0;
    for (int v = v0; v <= v1; ++v) {
      const float* row = cells.shortest.data() + static_cast<size_t>(v) * (cells.u_mask + 1);
      float shortest = kNever;
      for (int u = u0; u <= u1; ++u) shortest = std::min(shortest, row[u & cells.u_mask]);
      if (shortest <= window.distance) return 0;
      rows += shortest < kNever ? 1 : 0;
    }
    return rows;
  }

  // One target among the rays.
  struct Search {
    const RayBins& bins;
    Target target;
    std::array<float, 3> corner;
    uint64_t mask;
  };

  // Whether any ray of the bins [u0, u1] of a row passes the target; rays of bins behind them may be looked at as well.
  MAPKEEP_INLINE bool AnyOfRow(const Search& search, int v, int u0, int u1) {
    const RayBins& bins = search.bins;
    const int bins_u = bins.layout_.bins_u;
    const uint32_t* row = bins.starts_.data() + static_cast<size_t>(v) * bins_u;
    const int first = u0 & (bins_u - 1), last = first + std::min(u1 - u0, bins_u - 1);
    uint32_t i = row[first], end = row[std::min(last, bins_u - 1) + 1];
    bool wraps = last >= bins_u;
    Passing passing;
    while (true) {
      if (i >= end) {
        if (!wraps) return false;
        wraps = false;
        i = row[0];
        end = row[last - bins_u + 1];
        continue;
      }
      Pass(bins.inverse_[0].data() + i, bins.inverse_[1].data() + i, bins.inverse_[2].data() + i, search.target,
           bins.share_, passing);
      if (passing.any != 0 && (search.mask == kFullMask || AnyPassesMask(search, i, passing))) return true;
      i += kLanes;
    }
  }

  // Which of the lanes pass an occupied sub-voxel as well.
  static bool AnyPassesMask(const Search& search, uint32_t first, const Passing& passing) {
    const RayBins& bins = search.bins;
    for (size_t k = 0; k < kLanes; ++k) {
      if (passing.passes[k] == 0) continue;
      const std::array along = {bins.along_[0][first + k], bins.along_[1][first + k], bins.along_[2][first + k]};
      if (PassesMask(along, passing.enter[k], passing.leave[k], search.corner, search.mask)) return true;
    }
    return false;
  }

  MAPKEEP_INLINE bool AnyRay(const Search& search, const Window& window) {
    const bool wide = window.u1 - window.u0 >= 2 * kCoarseBins;
    if (!wide) {
      // From the middle outwards: most targets that are passed at all are passed by a ray through their middle.
      const int rows = window.v1 - window.v0 + 1, middle = (window.v0 + window.v1) / 2;
      for (int k = 0, v = middle; k < rows; ++k) {
        if (AnyOfRow(search, v, window.u0, window.u1)) return true;
        v += k % 2 == 0 ? k + 1 : -(k + 1);
      }
      return false;
    }
    // A wide window is gone through in cells of 4 x 4 bins, most of which do not reach.
    const Level& coarse = search.bins.levels_[kCoarse];
    for (int v = window.v0 >> kCoarse; v <= window.v1 >> kCoarse; ++v) {
      const float* row = coarse.reach.data() + static_cast<size_t>(v) * (coarse.u_mask + 1);
      for (int u = window.u0 >> kCoarse; u <= window.u1 >> kCoarse; ++u) {
        if (row[u & coarse.u_mask] < window.distance) continue;
        const int first = std::max(window.u0, u << kCoarse),
                  last = std::min(window.u1, (u << kCoarse) + kCoarseBins - 1);
        const int low = std::max(window.v0, v << kCoarse), high = std::min(window.v1, (v << kCoarse) + kCoarseBins - 1);
        for (int at = low; at <= high; ++at) {
          if (AnyOfRow(search, at, first, last)) return true;
        }
      }
    }
    return false;
  }

  // Whether any ray passes a voxel, whatever of it is occupied.
  static bool AnyRayInVoxel(const RayBins& bins, const Layout& layout, const std::array<float, 3>& corner) {
    const Search search{
        bins, {{corner[0], corner[1], corner[2]}, {corner[0] + 1, corner[1] + 1, corner[2] + 1}}, corner, kFullMask};
    const Window window = WindowOf(layout, corner[0] + 0.5F, corner[1] + 0.5F, corner[2] + 0.5F, 0.7072F, 0.50001F);
    return Reaches(bins, window) && AnyRay(search, window);
  }

  MAPKEEP_INLINE void Look(const RayBins& bins, const RayTargets& targets, const Clearance& clearance, uint8_t* seen) {
    const Layout layout = bins.layout_;
    Windows windows, around;
    for (size_t begin = 0; begin < targets.size(); begin += kLanes) {
      const RayTargets::Group& group = targets.groups()[begin / kLanes];
      WindowsOf(layout, group, windows);
      if (clearance.around > 0) WindowsAround(layout, group, clearance, around);
      for (size_t lane = 0; lane < std::min(kLanes, targets.size() - begin); ++lane) {
        uint8_t& bits = seen[begin + lane];
        bits = 0;
        const Window window = windows.At(lane);
        if (!Reaches(bins, window)) continue;
        const Search search{bins,
                            {{group.low[0][lane], group.low[1][lane], group.low[2][lane]},
                             {group.high[0][lane], group.high[1][lane], group.high[2][lane]}},
                            {group.corner[0][lane], group.corner[1][lane], group.corner[2][lane]},
                            group.masks[lane]};
        const bool seen_through = AnyRay(search, window);
        if (seen_through) bits = kSeenThrough;
        if (clearance.around <= 0 || !(seen_through || group.sparse[lane])) continue;
        const int rows = ClearRows(bins, around.At(lane));
        if (seen_through && rows > 0) bits |= kConfirmed;
        if (rows >= kClearRows && (seen_through || AnyRayInVoxel(bins, layout, search.corner))) bits |= kClear;
      }
    }
  }

  MAPKEEP_AVX2 static void LookAvx2(const RayBins& bins, const RayTargets& targets, const Clearance& clearance,
                                    uint8_t* seen) {
    Look(bins, targets, clearance, seen);
  }
  static void LookPlain(const RayBins& bins, const RayTargets& targets, const Clearance& clearance, uint8_t* seen) {
    Look(bins, targets, clearance, seen);
  }

  MAPKEEP_AVX2 static void DirectionsAvx2(const float* x, const float* y, const float* z, size_t count, float* diamond,
                                          float* sine, float* length) {
    Directions(x, y, z, count, diamond, sine, length);
  }
  static void DirectionsPlain(const float* x, const float* y, const float* z, size_t count, float* diamond, float* sine,
                              float* length) {
    Directions(x, y, z, count, diamond, sine, length);
  }

  static bool HasAvx2() {
#if defined(__x86_64__)
    static const bool has = __builtin_cpu_supports("avx2") != 0;
    return has;
#else
    return false;
#endif
  }
};

void RayBins::Build(const std::array<std::vector<float>, 3>& to_ends, float share) {
  const size_t count = to_ends[0].size();
  share_ = share;
  diamond_.resize(count);
  sine_.resize(count);
  length_.resize(count);
  (Kernels::HasAvx2() ? Kernels::DirectionsAvx2 : Kernels::DirectionsPlain)(
      to_ends[0].data(), to_ends[1].data(), to_ends[2].data(), count, diamond_.data(), sine_.data(), length_.data());
  // How much of the sphere the scan covers, to have about the same number of rays in a bin for every sensor.
  float low = 1, high = -1;
  uint64_t sectors = 0;  // 64 around
  for (size_t i = 0; i < count; ++i) {
    low = std::min(low, sine_[i]);
    high = std::max(high, sine_[i]);
    sectors |= uint64_t{1} << (static_cast<int>(16 * diamond_[i]) & 63);
  }
  const double height = std::max<double>(high - low, 1e-3);
  const double width = 2 * std::numbers::pi * std::popcount(sectors) / 64;
  const double wanted = std::max(1.0, static_cast<double>(count) / kRaysABin);
  const double edge = std::sqrt(width * height / wanted);
  const auto around = static_cast<uint32_t>(std::clamp(2 * std::numbers::pi / edge, 16.0, 0.5 * kMaxBinsAround));
  layout_.bins_u = static_cast<int>(std::bit_ceil(around));
  layout_.bins_v = static_cast<int>(std::clamp(height / edge, 1.0, double{kMaxBinsUp}));
  layout_.sine_low = low;
  layout_.sine_high = high;
  layout_.v_scale = static_cast<float>(layout_.bins_v / height);
  layout_.u_scale = static_cast<float>(layout_.bins_u / 4.0);

  const size_t bins = static_cast<size_t>(layout_.bins_u) * layout_.bins_v;
  const auto longer = static_cast<uint32_t>(std::max(layout_.bins_u, layout_.bins_v));
  levels_.resize(std::max<size_t>(kCoarse + 1, std::bit_width(longer)));
  for (size_t level = 0; level < levels_.size(); ++level) {
    Level& cells = levels_[level];
    cells.u_mask = std::max(1, layout_.bins_u >> level) - 1;
    cells.v_count = ((layout_.bins_v - 1) >> level) + 1;
    const size_t size = static_cast<size_t>(cells.u_mask + 1) * cells.v_count;
    cells.reach.assign(size, 0);
    cells.shortest.assign(size, kNever);
  }
  bin_of_.resize(count);
  Kernels::BinsOf(layout_, diamond_.data(), sine_.data(), count, bin_of_.data());
  starts_.assign(bins + 1, 0);
  for (size_t i = 0; i < count; ++i) {
    const uint32_t bin = bin_of_[i];
    ++starts_[bin + 1];
    float& reach = levels_[0].reach[bin];
    reach = std::max(reach, kRoundingUp * share * length_[i]);
    float& shortest = levels_[0].shortest[bin];
    shortest = std::min(shortest, length_[i]);
  }
  for (size_t bin = 0; bin < bins; ++bin) starts_[bin + 1] += starts_[bin];
  for (int axis = 0; axis < 3; ++axis) {
    along_[axis].resize(count + kLanes);
    inverse_[axis].resize(count + kLanes);
  }
  // Filling moves each start to the next bin's; so they are filled from the end backwards, which leaves them right.
  for (size_t i = count; i-- > 0;) {
    const uint32_t at = --starts_[bin_of_[i] + 1];
    for (int axis = 0; axis < 3; ++axis) along_[axis][at] = to_ends[axis][i];
  }
  for (size_t bin = 0; bin < bins; ++bin) starts_[bin] = starts_[bin + 1];
  starts_[bins] = static_cast<uint32_t>(count);
  for (int axis = 0; axis < 3; ++axis) {
    // Rays that lead nowhere pass nothing.
    std::fill(along_[axis].begin() + static_cast<std::ptrdiff_t>(count), along_[axis].end(), 0.0F);
    Kernels::Inverses(along_[axis].data(), along_[axis].size(), inverse_[axis].data());
  }

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
        float& shortest = here.shortest[to + (u >> halving_u)];
        shortest = std::min(shortest, below.shortest[row + u]);
      }
    }
  }
}

bool RayBins::MayReach(const Region& region) const {
  return Kernels::Reaches(*this, WindowOf(layout_, region.centre[0], region.centre[1], region.centre[2], region.radius,
                                          region.half_height));
}

void RayBins::Look(const RayTargets& targets, const Clearance& clearance, std::vector<uint8_t>& seen) const {
  seen.resize(targets.size());
  (Kernels::HasAvx2() ? Kernels::LookAvx2 : Kernels::LookPlain)(*this, targets, clearance, seen.data());
}

}  // namespace mapkeep
