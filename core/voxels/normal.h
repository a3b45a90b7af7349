#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>

namespace mapkeep {

/// A unit vector in two bytes: the octahedral map (Cigolle et al., "A Survey of Efficient Representations for
/// Independent Unit Vectors", 2014), worst error about 1 degree. {0, 0} means "no normal".
std::array<uint8_t, 2> EncodeNormal(const Eigen::Vector3d& unit);

/// The unit vector of two bytes; zero for "no normal".
Eigen::Vector3d DecodeNormal(const std::array<uint8_t, 2>& bytes);

}  // namespace mapkeep
