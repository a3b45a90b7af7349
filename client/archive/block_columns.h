#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "client/archive/byte_string.h"
#include "core/voxels/block.h"

namespace mapkeep {

inline constexpr size_t kVoxelBytes = 29;  ///< of a voxel in an archive's columns

/// Appends a block as the archive's grammar has it (map_archive.h).
void PutBlock(std::string* bytes, const Block& block);

/// DATA_LOSS if the bytes end early, or hold a block that no map can have.
absl::StatusOr<Block> TakeBlock(ByteCursor* bytes);

}  // namespace mapkeep
