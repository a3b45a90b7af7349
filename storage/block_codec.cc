#include "storage/block_codec.h"

#include <absl/strings/str_format.h>

#include <cstring>

#include "core/checksum/crc32c.h"
#include "storage/byte_planes.h"
#include "storage/text.h"
#include "storage/zstd.h"

namespace mapkeep {
namespace {

constexpr char kMagic = 'B';
constexpr char kVersion = 1;
constexpr size_t kChecksumAt = 2, kKeyAt = 6, kCountAt = 14, kColumnsAt = 18;
constexpr size_t kBytesPerVoxel = 2 + 2 + 2 + 1 + 3 + 2 + 1 + 8 + 4 + 4;
constexpr size_t kMaxVoxels = size_t{1} << (3 * kBlockBits);
constexpr int kZstdLevel = 1;  // 3 saves about one percent and costs twice the time

absl::Status CheckVoxels(const Block& block) {
  int last = -1;
  for (const Voxel& voxel : block.voxels) {
    if (voxel.position <= last || voxel.position >= kMaxVoxels) {
      return absl::InvalidArgumentError(absl::StrFormat("block %x: voxel position %d after %d",
                                                        static_cast<uint64_t>(block.key), voxel.position, last));
    }
    last = voxel.position;
  }
  if (last < 0) return absl::InvalidArgumentError("a block without voxels is not stored");
  return absl::OkStatus();
}

Parts Columns(const std::vector<Voxel>& voxels) {
  const size_t count = voxels.size();
  Parts parts;
  std::string& out = parts.bytes;
  out.reserve(kBytesPerVoxel * count);
  AppendPlanes<2>(out, count, [&](size_t i) { return voxels[i].position - (i == 0 ? 0 : voxels[i - 1].position); });
  parts.Cut();
  AppendPlanes<2>(out, count, [&](size_t i) { return voxels[i].hits; });
  parts.Cut();
  AppendPlanes<2>(out, count, [&](size_t i) { return voxels[i].exposures; });
  parts.Cut();
  AppendPlanes<1>(out, count, [&](size_t i) {
    return (voxels[i].ground ? 1 : 0) | (voxels[i].is_static ? 2 : 0) | (voxels[i].is_new ? 4 : 0);
  });
  parts.Cut();
  for (int axis = 0; axis < 3; ++axis) AppendPlanes<1>(out, count, [&](size_t i) { return voxels[i].mean[axis]; });
  parts.Cut();
  for (int part = 0; part < 2; ++part) AppendPlanes<1>(out, count, [&](size_t i) { return voxels[i].normal[part]; });
  parts.Cut();
  AppendPlanes<1>(out, count, [&](size_t i) { return voxels[i].intensity; });
  parts.Cut();
  AppendPlanes<8>(out, count, [&](size_t i) { return voxels[i].mask; });
  parts.Cut();
  AppendPlanes<4>(out, count, [&](size_t i) { return voxels[i].first_seen; });
  AppendPlanes<4>(out, count, [&](size_t i) { return voxels[i].last_seen - voxels[i].first_seen; });
  parts.Cut();
  return parts;
}

std::vector<Voxel> VoxelsOf(const char* columns, size_t count) {
  std::vector<Voxel> voxels(count);
  uint16_t position = 0;
  columns = ReadPlanes<2>(columns, count, [&](size_t i, uint64_t step) {
    position = static_cast<uint16_t>(position + step);
    voxels[i].position = position;
  });
  columns = ReadPlanes<2>(columns, count, [&](size_t i, uint64_t hits) { voxels[i].hits = hits; });
  columns = ReadPlanes<2>(columns, count, [&](size_t i, uint64_t exposures) { voxels[i].exposures = exposures; });
  columns = ReadPlanes<1>(columns, count, [&](size_t i, uint64_t flags) {
    voxels[i].ground = (flags & 1) != 0;
    voxels[i].is_static = (flags & 2) != 0;
    voxels[i].is_new = (flags & 4) != 0;
  });
  for (int axis = 0; axis < 3; ++axis) {
    columns = ReadPlanes<1>(columns, count, [&](size_t i, uint64_t mean) { voxels[i].mean[axis] = mean; });
  }
  for (int part = 0; part < 2; ++part) {
    columns = ReadPlanes<1>(columns, count, [&](size_t i, uint64_t normal) { voxels[i].normal[part] = normal; });
  }
  columns = ReadPlanes<1>(columns, count, [&](size_t i, uint64_t intensity) { voxels[i].intensity = intensity; });
  columns = ReadPlanes<8>(columns, count, [&](size_t i, uint64_t mask) { voxels[i].mask = mask; });
  columns = ReadPlanes<4>(columns, count, [&](size_t i, uint64_t minutes) { voxels[i].first_seen = minutes; });
  ReadPlanes<4>(columns, count, [&](size_t i, uint64_t age) { voxels[i].last_seen = voxels[i].first_seen + age; });
  return voxels;
}

uint32_t ChecksumOf(std::string_view value) {
  return Crc32c(value.substr(kKeyAt), Crc32c(value.substr(0, kChecksumAt)));
}

}  // namespace

absl::StatusOr<std::string> EncodeBlock(const Block& block) {
  if (absl::Status status = CheckVoxels(block); !status.ok()) return status;
  absl::StatusOr<std::string> columns = Compress(Columns(block.voxels), kZstdLevel);
  if (!columns.ok()) return columns.status();
  std::string value;
  value.reserve(kColumnsAt + columns->size());
  value.push_back(kMagic);
  value.push_back(kVersion);
  AppendNumber<4>(value, 0);
  AppendNumber<8>(value, static_cast<uint64_t>(block.key));
  AppendNumber<4>(value, block.voxels.size());
  value.append(*columns);
  std::string checksum;
  AppendNumber<4>(checksum, ChecksumOf(value));
  std::memcpy(value.data() + kChecksumAt, checksum.data(), checksum.size());
  return value;
}

absl::StatusOr<Block> DecodeBlock(std::string_view value, BlockKey key) {
  const auto damaged = [key](std::string_view what) {
    const VoxelIndex block = BlockIndexOf(key);
    return absl::DataLossError(absl::StrFormat("block (%d, %d, %d): %s", block.x, block.y, block.z, what));
  };
  if (value.size() <= kColumnsAt) return damaged("the value is cut short");
  if (NumberAt<4>(value.data() + kChecksumAt) != ChecksumOf(value)) return damaged("the checksum does not match");
  if (value[0] != kMagic) return damaged("this is not a block");
  if (value[1] != kVersion) return damaged(absl::StrFormat("format version %d, known is %d", value[1], kVersion));
  if (NumberAt<8>(value.data() + kKeyAt) != static_cast<uint64_t>(key)) return damaged("this is another block's value");
  const size_t count = NumberAt<4>(value.data() + kCountAt);
  if (count == 0 || count > kMaxVoxels) return damaged(absl::StrFormat("it claims %d voxels", count));
  absl::StatusOr<std::string> columns = Decompress(value.substr(kColumnsAt), kBytesPerVoxel * count);
  if (!columns.ok()) return damaged(FromAbsl(columns.status().message()));
  Block block{key, VoxelsOf(columns->data(), count)};
  if (absl::Status status = CheckVoxels(block); !status.ok()) return damaged(FromAbsl(status.message()));
  return block;
}

}  // namespace mapkeep
