#include "core/tiling/point_colour.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "core/voxels/normal.h"

namespace mapkeep {
namespace {

constexpr double kRise = 20;    // metres from one end of the ramp to the other
constexpr double kLowest = -4;  // metres: where a ramp begins

// Ever lighter, and told apart by those who do not see red and green as two.
constexpr std::array<std::array<double, 3>, 6> kRamp = {
    {{62, 60, 140}, {46, 106, 160}, {34, 152, 154}, {74, 190, 112}, {168, 214, 60}, {250, 226, 70}}};

}  // namespace

std::array<uint8_t, 3> ColourAt(double height, const std::array<uint8_t, 2>& normal) {
  const double turns = (height - kLowest) / (2 * kRise);
  const double along = 1 - std::abs(2 * (turns - std::floor(turns)) - 1);  // 0 to 1 and back
  const double at = along * (kRamp.size() - 1);
  const auto below = std::min(static_cast<size_t>(at), kRamp.size() - 2);
  const double share = at - static_cast<double>(below);
  const Eigen::Vector3d unit = DecodeNormal(normal);
  const double light = unit.isZero() ? 0.9 : 0.75 + 0.25 * unit.dot(Eigen::Vector3d(0.36, 0.48, 0.8));
  std::array<uint8_t, 3> colour;
  for (size_t i = 0; i < colour.size(); ++i) {
    const double value = (1 - share) * kRamp[below][i] + share * kRamp[below + 1][i];
    colour[i] = static_cast<uint8_t>(std::lround(std::clamp(light * value, 0.0, 255.0)));
  }
  return colour;
}

}  // namespace mapkeep
