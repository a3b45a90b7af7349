#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "core/voxels/voxel_index.h"

namespace mapkeep {

/// One voxel of the Voxel Ratio Map. Only voxels that were ever hit exist.
struct Voxel {
  uint16_t position = 0;   ///< PositionInBlock
  uint16_t hits = 0;       ///< H, fixed point in units of 1/8 scan (kCountScale)
  uint16_t exposures = 0;  ///< E, likewise
  bool ground = false;
  bool is_static = false;           ///< the map filter's verdict: exports, tiles and registration use it
  bool is_new = false;              ///< not static yet: one session alone met it, where others had seen nothing
  std::array<uint8_t, 3> mean{};    ///< mean point inside the voxel, 1/256 of its edge an axis (see MeanOf)
  std::array<uint8_t, 2> normal{};  ///< octahedral, oriented towards the trajectory (see core/voxels/normal.h)
  uint8_t intensity = 0;            ///< mean, 255 is 1.0
  uint64_t mask = 0;                ///< 4x4x4 sub-voxel occupancy, bit x + 4 y + 16 z
  uint32_t first_seen = 0;          ///< start of the first session that hit it, minutes since 2000-01-01 UTC
  uint32_t last_seen = 0;           ///< start of the last one, likewise

  bool operator==(const Voxel&) const = default;
};

/// Whether the map filter holds a voxel to be there, however many sessions met it.
constexpr bool Stands(const Voxel& voxel) { return voxel.is_static || voxel.is_new; }

inline constexpr int kCountScale = 8;  ///< a count of one scan is stored as 8

/// R of eq. 4 from counts in any common unit (eta is added in scans, so scale it likewise).
constexpr double Stability(double hits, double exposures, double eta) { return hits / (hits + exposures + eta); }

/// A block of voxels: a value, sorted by position, none twice.
struct Block {
  BlockKey key{};
  std::vector<Voxel> voxels;

  bool operator==(const Block&) const = default;
};

/// A block and its 26 neighbours in the order of NeighbourhoodOf; nullptr where the map has none. The block itself is
/// entry 13.
using BlockNeighbourhood = std::array<const Block*, 27>;

/// The voxel at a position, or nullptr.
const Voxel* FindVoxel(const Block& block, uint16_t position);

/// The stored mean point of a voxel, metres relative to the map's origin.
Eigen::Vector3d MeanOf(const Block& block, const Voxel& voxel, double voxel_size);

/// Centres of the occupied sub-voxels (a quarter of the voxel's edge), metres relative to the map's origin.
std::vector<Eigen::Vector3d> SubVoxelPoints(const Block& block, const Voxel& voxel, double voxel_size);

}  // namespace mapkeep
