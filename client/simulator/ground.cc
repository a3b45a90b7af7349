#include "client/simulator/ground.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace mapkeep {
namespace {

constexpr double kKnot = 50;       // metres between knots of heading and height
constexpr double kLongKnot = 200;  // metres between knots of the long waves of height
constexpr double kLineStep = 0.25;
constexpr double kBend = 0.12;    // radians: headings are within this of the row's
constexpr double kHill = 0.6;     // metres
constexpr double kLongHill = 2;   // metres
constexpr double kCamber = 0.02;  // the road falls by this from its middle
constexpr double kKerbHeight = 0.12;
constexpr double kLoweredKerb = 0.03;
constexpr double kRampBegin = kBuildingLine + 0.4, kRampEnd = 19, kRampRise = 1.6;
constexpr double kSwell = 1.1;  // metres: how far a lawn rises

double SmoothStep(double t) {
  t = std::clamp(t, 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

/// Smooth between knots `spacing` apart, the first at `begin`.
double Interpolated(const std::vector<double>& knots, double spacing, double begin, double s) {
  const double u = std::clamp((s - begin) / spacing, 0.0, static_cast<double>(knots.size() - 1) - 1e-9);
  const auto i = static_cast<size_t>(u);
  return knots[i] + SmoothStep(u - static_cast<double>(i)) * (knots[i + 1] - knots[i]);
}

double Centred(uint64_t seed) { return static_cast<double>(HashBits(seed) >> 11) * 0x1p-52 - 1; }

double KerbAt(const StreetPlan& plan, double s, int side) {
  const Lot* lot = LotAt(plan, s, side);
  if (lot == nullptr) return s < 1 || s > kCrossing - 1 ? kKerbHeight : 0;
  const bool drive = lot->kind == LotKind::kRamp || (lot->kind == LotKind::kCarPark && s < lot->begin + 5) ||
                     (lot->kind == LotKind::kCarDecks && s > lot->begin + 6 && s < lot->begin + 12);
  return drive ? kLoweredKerb : kKerbHeight;
}

/// What the ground of a lot adds to the height of its pavement.
double RiseAt(const Lot& lot, double s, double a) {
  if (lot.kind == LotKind::kRamp) return kRampRise * std::clamp((a - kRampBegin) / (kRampEnd - kRampBegin), 0.0, 1.0);
  if (lot.kind == LotKind::kPark) {
    const double across = SmoothStep((a - 10) / 10);
    const double along = std::sin(std::numbers::pi * std::clamp((s - lot.begin) / (lot.end - lot.begin), 0.0, 1.0));
    return kSwell * across * along;
  }
  return 0;
}

struct Line {
  double d;
  bool on_kerb;  // the upper of the two lines at the kerb
};

std::vector<Line> LinesAcross() {
  constexpr std::array<double, 8> kRoad = {0, 0.8, 1.65, 2.5, 3.3, 4.1, 4.8, kKerb};
  constexpr std::array<double, 19> kBeyond = {
      kKerb, 5.9, 6.5, 7.2, 7.9, kBuildingLine, kRampBegin, 10, 12, 14, 16, 17.5, kRampEnd, 21, 24, 28, 34, 45, 60};
  std::vector<Line> lines;
  lines.reserve(2 * (kRoad.size() + kBeyond.size()));
  for (const double d : kRoad) lines.push_back({d, false});
  for (const double d : kBeyond) lines.push_back({d, true});
  const size_t half = lines.size();
  for (size_t i = 1; i < half; ++i) lines.insert(lines.begin(), {-lines[2 * i - 1].d, lines[2 * i - 1].on_kerb});
  return lines;
}

Material GroundMaterial(const StreetPlan& plan, double s, double d) {
  const double a = std::abs(d);
  const Lot* lot = LotAt(plan, s, d > 0 ? 1 : -1);
  if (a < kKerb || lot == nullptr) return Material::kAsphalt;
  if (a < kBuildingLine) return Material::kPaving;
  switch (lot->kind) {
    case LotKind::kPark:
      return Material::kGrass;
    case LotKind::kCarPark:
    case LotKind::kRamp:
      return a < 28 ? Material::kAsphalt : Material::kGrass;
    case LotKind::kCarDecks:
      return Material::kConcrete;
    default:
      return a < 28 ? Material::kPaving : Material::kGrass;
  }
}

}  // namespace

Ground::Ground(uint64_t seed, int streets, bool repeated, bool level) : streets_(streets) {
  const auto seed_of = [&](int64_t street) { return SeedOf(seed, repeated ? 0 : static_cast<uint64_t>(street + 1)); };
  for (int i = -1; i <= streets; ++i) plans_.push_back(PlanStreet(seed_of(i), kStreetLength * i));
  // Knots belong to the street that they lie in, so that copies of a street bend and climb alike.
  for (int i = -1; i <= streets + 1; ++i) {
    for (uint64_t k = 0; k < 2; ++k) {
      heading_knots_.push_back(level ? 0 : kBend * Centred(SeedOf(seed_of(i), 1000 + k)));
      height_knots_.push_back(level ? 0 : kHill * Centred(SeedOf(seed_of(i), 2000 + k)));
    }
    long_height_knots_.push_back(repeated || level ? 0 : kLongHill * Centred(SeedOf(seed_of(i), 3000)));
  }
  Eigen::Vector2d point(0, 0);
  for (double s = begin(); s <= end() + kLineStep; s += kLineStep) {
    line_.push_back(point);
    const double heading = HeadingAt(s + kLineStep / 2);
    point += kLineStep * Eigen::Vector2d(std::cos(heading), std::sin(heading));
  }
  const Eigen::Vector2d origin = line_[static_cast<size_t>(-begin() / kLineStep)];
  for (Eigen::Vector2d& p : line_) p -= origin;
}

double Ground::HeadingAt(double s) const { return Interpolated(heading_knots_, kKnot, begin(), s); }

double Ground::ProfileAt(double s) const {
  return Interpolated(height_knots_, kKnot, begin(), s) + Interpolated(long_height_knots_, kLongKnot, begin(), s);
}

const StreetPlan& Ground::PlanAt(double s) const {
  const auto index = static_cast<int>(std::floor(s / kStreetLength)) + 1;
  return plans_[static_cast<size_t>(std::clamp(index, 0, static_cast<int>(plans_.size()) - 1))];
}

double Ground::HeightAt(double s, double d) const {
  const double a = std::abs(d);
  const double base = ProfileAt(s) - kCamber * std::min(a, kKerb);
  if (a < kKerb) return base;
  const StreetPlan& plan = PlanAt(s);
  const double along = s - plan.begin;
  const int side = d > 0 ? 1 : -1;
  const double pavement = base + KerbAt(plan, along, side) + 0.015 * (std::min(a, kBuildingLine) - kKerb);
  const Lot* lot = LotAt(plan, along, side);
  return a <= kBuildingLine || lot == nullptr ? pavement : pavement + RiseAt(*lot, along, a);
}

Eigen::Vector3d Ground::PointAt(double s, double d, double above) const {
  const double u = std::clamp((s - begin()) / kLineStep, 0.0, static_cast<double>(line_.size() - 1) - 1e-9);
  const auto i = static_cast<size_t>(u);
  const double t = u - static_cast<double>(i);
  const Eigen::Vector2d on_line = (1 - t) * line_[i] + t * line_[i + 1];
  const double heading = HeadingAt(s);
  return {on_line.x() - d * std::sin(heading), on_line.y() + d * std::cos(heading), HeightAt(s, d) + above};
}

Pose Ground::UprightAt(double s, double d, double yaw, double above) const {
  return Eigen::Translation3d(PointAt(s, d, above)) * Eigen::AngleAxisd(HeadingAt(s) + yaw, Eigen::Vector3d::UnitZ());
}

Pose Ground::OnWheelsAt(double s, double d, double yaw, double above) const {
  constexpr double kHalfBase = 1.3, kHalfTrack = 0.7;
  const double c = std::cos(yaw), n = std::sin(yaw);
  const auto height = [&](double forward, double left) {
    return HeightAt(s + c * forward - n * left, d + n * forward + c * left);
  };
  const double front = height(kHalfBase, 0), rear = height(-kHalfBase, 0);
  const double left = height(0, kHalfTrack), right = height(0, -kHalfTrack);
  Pose pose = UprightAt(s, d, yaw, above);
  pose.translation().z() += (front + rear) / 2 - HeightAt(s, d);
  return pose * Eigen::AngleAxisd(-std::atan2(front - rear, 2 * kHalfBase), Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(std::atan2(left - right, 2 * kHalfTrack), Eigen::Vector3d::UnitX());
}

TriangleMesh Ground::MeshOf(const StreetPlan& plan) const {
  const std::vector<Line> lines = LinesAcross();
  const auto columns = static_cast<size_t>(kStreetLength);
  const Eigen::Vector3d origin = PointAt(plan.begin, 0);
  TriangleMesh mesh;
  for (size_t i = 0; i <= columns; ++i) {
    const double along = static_cast<double>(i);
    for (size_t j = 0; j < lines.size(); ++j) {
      const double sign = lines[j].d < 0 ? -1 : 1;
      const double d = lines[j].on_kerb || lines[j].d == 0 ? lines[j].d : lines[j].d - sign * 1e-6;
      const double rough = GroundMaterial(plan, along, d) == Material::kGrass ? 0.03 : 0.005;
      // The first and last rows are shared with the neighbours and stay smooth, so that no gap opens.
      const bool shared = i == 0 || i == columns;
      const double bump = shared ? 0 : rough * Centred(SeedOf(plan.seed, 10000 + i * lines.size() + j));
      // A kerb's face leans by a centimetre: a vertical one would have no extent seen from above.
      const double lean = lines[j].on_kerb && std::abs(lines[j].d) == kKerb ? 0.01 * sign : 0;
      mesh.vertices.emplace_back((PointAt(plan.begin + along, d + lean, bump) - origin).cast<float>());
    }
  }
  for (size_t i = 0; i < columns; ++i) {
    for (size_t j = 0; j + 1 < lines.size(); ++j) {
      const auto at = [&](size_t row, size_t line) { return static_cast<uint32_t>(row * lines.size() + line); };
      const Material material = GroundMaterial(plan, static_cast<double>(i) + 0.5, (lines[j].d + lines[j + 1].d) / 2);
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
      mesh.materials.insert(mesh.materials.end(), 2, material);
    }
  }
  return mesh;
}

}  // namespace mapkeep
