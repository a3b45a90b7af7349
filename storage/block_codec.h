#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <string_view>

#include "core/voxels/block.h"

namespace mapkeep {

// A block as it is stored. Numbers are little-endian.
//
//   value   := 'B' version:u8 checksum:u32 key:u64 count:u32 columns
//   version := 1
//   checksum: CRC-32C of the whole value without these four bytes
//   key     := BlockKey, so that a value read under another block's name is noticed
//   count   := voxels, 1 to 32,768
//   columns := one zstd frame of
//                step       u16 x count   position minus the one before it (the first: minus 0)
//                hits       u16 x count
//                exposures  u16 x count
//                flags      u8  x count   bit 0 ground, bit 1 static
//                mean       u8  x count, three times: x, y, z
//                normal     u8  x count, twice
//                intensity  u8  x count
//                mask       u64 x count
//                first_seen u32 x count
//                age        u32 x count   last_seen minus first_seen, modulo 2^32
//   A column of n-byte numbers is written as n planes of bytes, the lowest bytes of all voxels first: equal high bytes
//   then lie together and vanish in the compression.

/// The value of a block with at least one voxel, sorted and none twice (INVALID_ARGUMENT otherwise). The same block
/// gives the same bytes.
absl::StatusOr<std::string> EncodeBlock(const Block& block);

/// The block of a value that is expected to hold `key`. DATA_LOSS naming the block if anything about it is wrong.
absl::StatusOr<Block> DecodeBlock(std::string_view value, BlockKey key);

}  // namespace mapkeep
