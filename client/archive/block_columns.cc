#include "client/archive/block_columns.h"

#include <absl/strings/str_format.h>

namespace mapkeep {
namespace {

constexpr uint8_t kGroundFlag = 1, kStaticFlag = 2, kNewFlag = 4;
constexpr uint32_t kPositions = kBlockSize * kBlockSize * kBlockSize;

}  // namespace

void PutBlock(std::string* bytes, const Block& block) {
  const VoxelIndex index = BlockIndexOf(block.key);
  for (const int32_t c : {index.x, index.y, index.z}) PutNumber(bytes, c);
  PutNumber(bytes, static_cast<uint32_t>(block.voxels.size()));
  const auto column = [&](auto field) {
    for (const Voxel& voxel : block.voxels) PutNumber(bytes, field(voxel));
  };
  column([](const Voxel& v) { return v.position; });
  column([](const Voxel& v) { return v.hits; });
  column([](const Voxel& v) { return v.exposures; });
  column([](const Voxel& v) {
    return static_cast<uint8_t>((v.ground ? kGroundFlag : 0) | (v.is_static ? kStaticFlag : 0) |
                                (v.is_new ? kNewFlag : 0));
  });
  column([](const Voxel& v) { return v.mean; });
  column([](const Voxel& v) { return v.normal; });
  column([](const Voxel& v) { return v.intensity; });
  column([](const Voxel& v) { return v.mask; });
  column([](const Voxel& v) { return v.first_seen; });
  column([](const Voxel& v) { return v.last_seen; });
}

absl::StatusOr<Block> TakeBlock(ByteCursor* bytes) {
  const auto x = bytes->Take<int32_t>(), y = bytes->Take<int32_t>(), z = bytes->Take<int32_t>();
  const auto count = bytes->Take<uint32_t>();
  constexpr int32_t kLimit = kVoxelLimit >> kBlockBits;
  for (const int32_t c : {x, y, z}) {
    if (c < -kLimit || c >= kLimit) return absl::DataLossError("a block lies out of range");
  }
  const auto damaged = [&](const char* what) {
    return absl::DataLossError(absl::StrFormat("block (%d, %d, %d): %s", x, y, z, what));
  };
  if (!bytes->ok() || count == 0 || count > kPositions || bytes->left() < count * kVoxelBytes) {
    return damaged("its number of voxels cannot be");
  }
  Block block{BlockKeyOf(VoxelIndex{x, y, z}), std::vector<Voxel>(count)};
  const auto column = [&](auto field) {
    for (Voxel& voxel : block.voxels) field(voxel);
  };
  column([&](Voxel& v) { v.position = bytes->Take<uint16_t>(); });
  column([&](Voxel& v) { v.hits = bytes->Take<uint16_t>(); });
  column([&](Voxel& v) { v.exposures = bytes->Take<uint16_t>(); });
  bool flags_known = true;
  column([&](Voxel& v) {
    const auto flags = bytes->Take<uint8_t>();
    flags_known = flags_known && flags <= (kGroundFlag | kStaticFlag | kNewFlag);
    v.ground = (flags & kGroundFlag) != 0;
    v.is_static = (flags & kStaticFlag) != 0;
    v.is_new = (flags & kNewFlag) != 0;
  });
  column([&](Voxel& v) { v.mean = bytes->Take<std::array<uint8_t, 3>>(); });
  column([&](Voxel& v) { v.normal = bytes->Take<std::array<uint8_t, 2>>(); });
  column([&](Voxel& v) { v.intensity = bytes->Take<uint8_t>(); });
  column([&](Voxel& v) { v.mask = bytes->Take<uint64_t>(); });
  column([&](Voxel& v) { v.first_seen = bytes->Take<uint32_t>(); });
  column([&](Voxel& v) { v.last_seen = bytes->Take<uint32_t>(); });
  if (!flags_known) return damaged("it has a flag that is not known");
  for (size_t i = 0; i < count; ++i) {
    if (block.voxels[i].position >= kPositions || (i > 0 && block.voxels[i].position <= block.voxels[i - 1].position)) {
      return damaged("its positions are not sorted");
    }
  }
  return block;
}

}  // namespace mapkeep
