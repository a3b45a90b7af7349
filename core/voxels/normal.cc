#include "core/voxels/normal.h"

#include <algorithm>
#include <cmath>

namespace mapkeep {
namespace {

// [-1, 1] onto 1..255, so that {0, 0} stays free.
uint8_t Quantised(double value) {
  return static_cast<uint8_t>(std::lround(std::clamp(value, -1.0, 1.0) * 127.0) + 128);
}

double SignOf(double value) { return value < 0 ? -1.0 : 1.0; }

}  // namespace

std::array<uint8_t, 2> EncodeNormal(const Eigen::Vector3d& unit) {
  const double length = unit.cwiseAbs().sum();
  if (!(length > 0)) return {0, 0};
  double u = unit.x() / length, v = unit.y() / length;
  if (unit.z() < 0) {
    const double folded = (1 - std::abs(v)) * SignOf(u);
    v = (1 - std::abs(u)) * SignOf(v);
    u = folded;
  }
  return {Quantised(u), Quantised(v)};
}

Eigen::Vector3d DecodeNormal(const std::array<uint8_t, 2>& bytes) {
  if (bytes[0] == 0 && bytes[1] == 0) return Eigen::Vector3d::Zero();
  const double u = (bytes[0] - 128) / 127.0, v = (bytes[1] - 128) / 127.0;
  const double z = 1 - std::abs(u) - std::abs(v);
  const Eigen::Vector3d unit = z >= 0
                                   ? Eigen::Vector3d(u, v, z)
                                   : Eigen::Vector3d((1 - std::abs(v)) * SignOf(u), (1 - std::abs(u)) * SignOf(v), z);
  return unit.normalized();
}

}  // namespace mapkeep
