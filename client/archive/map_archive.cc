#include "client/archive/map_archive.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <zstd.h>

#include <cmath>
#include <string_view>
#include <system_error>
#include <utility>

#include "client/archive/block_columns.h"
#include "client/archive/byte_string.h"
#include "core/checksum/crc32c.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kMagic("MKMAP\x01\r\n", 8);
constexpr char kChunkTag = 'B', kEndTag = 'E';
constexpr size_t kChunkBytes = size_t{1} << 20;  ///< raw; a chunk ends with the block that reaches it
constexpr size_t kMostRawBytes = size_t{8} << 20;
constexpr size_t kMostStoredBytes = size_t{9} << 20;
constexpr int kCompressionLevel = 3;

}  // namespace

ArchiveWriter::ArchiveWriter(std::ostream& stream, const ArchiveHeader& header) : stream_(stream) {
  std::string bytes;
  PutNumber(&bytes, header.voxel_size);
  PutNumber(&bytes, static_cast<uint8_t>(header.origin.has_value()));
  const Eigen::Vector3d origin = header.origin.value_or(Eigen::Vector3d::Zero());
  for (const double c : {origin.x(), origin.y(), origin.z()}) PutNumber(&bytes, c);
  PutNumber(&bytes, static_cast<uint16_t>(header.crs.size()));
  bytes += header.crs;
  PutNumber(&bytes, Crc32c(bytes));
  stream_ << kMagic << bytes;
}

absl::Status ArchiveWriter::Add(const Block& block) {
  if (block.voxels.empty()) return absl::OkStatus();
  if (last_.has_value() && block.key <= *last_) return absl::InternalError("blocks of an archive are out of order");
  last_ = block.key;
  PutBlock(&raw_, block);
  ++raw_blocks_;
  ++blocks_;
  voxels_ += block.voxels.size();
  return raw_.size() < kChunkBytes ? absl::OkStatus() : WriteChunk();
}

absl::Status ArchiveWriter::WriteChunk() {
  std::string stored(ZSTD_compressBound(raw_.size()), '\0');
  const size_t size = ZSTD_compress(stored.data(), stored.size(), raw_.data(), raw_.size(), kCompressionLevel);
  if (ZSTD_isError(size) != 0) return absl::InternalError(absl::StrCat("zstd: ", ZSTD_getErrorName(size)));
  stored.resize(size);
  std::string head(1, kChunkTag);
  PutNumber(&head, raw_blocks_);
  PutNumber(&head, static_cast<uint32_t>(raw_.size()));
  PutNumber(&head, static_cast<uint32_t>(size));
  PutNumber(&head, Crc32c(stored));
  stream_ << head << stored;
  raw_.clear();
  raw_blocks_ = 0;
  return absl::OkStatus();
}

absl::Status ArchiveWriter::Finish() {
  if (raw_blocks_ > 0) {
    if (absl::Status status = WriteChunk(); !status.ok()) return status;
  }
  std::string end(1, kEndTag);
  PutNumber(&end, blocks_);
  PutNumber(&end, voxels_);
  PutNumber(&end, Crc32c(end));
  stream_ << end;
  return absl::OkStatus();
}

absl::StatusOr<ArchiveReader> ArchiveReader::Open(const fs::path& path) {
  std::error_code error;
  const uint64_t size = fs::file_size(path, error);
  std::ifstream stream(path, std::ios::binary);
  if (error || !stream) {
    return absl::NotFoundError(absl::StrCat(path.string(), ": cannot be read", error ? ": " + error.message() : ""));
  }
  ArchiveReader reader(path, std::move(stream), size);
  if (absl::Status status = reader.ReadHeader(); !status.ok()) return status;
  return reader;
}

absl::Status ArchiveReader::Damaged(std::string_view what) const {
  return absl::DataLossError(absl::StrFormat("%s: at byte %d: %s", path_.string(), at_, what));
}

absl::StatusOr<std::string> ArchiveReader::ReadBytes(size_t count) {
  std::string bytes(count, '\0');
  if (!stream_.read(bytes.data(), static_cast<std::streamsize>(count))) return Damaged("the archive ends early");
  at_ += count;
  return bytes;
}

absl::Status ArchiveReader::ReadHeader() {
  const absl::StatusOr<std::string> magic = ReadBytes(kMagic.size());
  if (!magic.ok() || magic->substr(0, 5) != kMagic.substr(0, 5)) {
    return absl::InvalidArgumentError(absl::StrCat(path_.string(), ": is no map archive (.mkmap)"));
  }
  if (*magic != kMagic) {
    return absl::InvalidArgumentError(
        absl::StrCat(path_.string(), ": is an archive of another version, or was changed as a text file"));
  }
  constexpr size_t kFixed = 8 + 1 + 24 + 2;
  absl::StatusOr<std::string> bytes = ReadBytes(kFixed);
  if (!bytes.ok()) return bytes.status();
  ByteCursor cursor(*bytes);
  header_.voxel_size = cursor.Take<double>();
  const bool has_origin = cursor.Take<uint8_t>() != 0;
  const auto x = cursor.Take<double>(), y = cursor.Take<double>(), z = cursor.Take<double>();
  if (has_origin) header_.origin = Eigen::Vector3d(x, y, z);
  const absl::StatusOr<std::string> crs = ReadBytes(cursor.Take<uint16_t>());
  if (!crs.ok()) return crs.status();
  header_.crs = *crs;
  const absl::StatusOr<std::string> sum = ReadBytes(sizeof(uint32_t));
  if (!sum.ok()) return sum.status();
  if (ByteCursor(*sum).Take<uint32_t>() != Crc32c(*crs, Crc32c(*bytes)))
    return Damaged("the header's checksum is wrong");
  return absl::OkStatus();
}

absl::StatusOr<std::vector<Block>> ArchiveReader::Next() {
  const absl::StatusOr<std::string> tag = ReadBytes(1);
  if (!tag.ok()) return tag.status();
  if (tag->front() == kEndTag) {
    if (absl::Status status = CheckEnd(); !status.ok()) return status;
    return std::vector<Block>();
  }
  if (tag->front() != kChunkTag) return Damaged("expected a chunk or the end");
  const absl::StatusOr<std::string> head = ReadBytes(4 * sizeof(uint32_t));
  if (!head.ok()) return head.status();
  ByteCursor cursor(*head);
  const auto count = cursor.Take<uint32_t>(), raw_size = cursor.Take<uint32_t>(), stored_size = cursor.Take<uint32_t>(),
             checksum = cursor.Take<uint32_t>();
  if (count == 0 || raw_size > kMostRawBytes || stored_size > kMostStoredBytes)
    return Damaged("a chunk's size cannot be");
  const absl::StatusOr<std::string> stored = ReadBytes(stored_size);
  if (!stored.ok()) return stored.status();
  if (Crc32c(*stored) != checksum) return Damaged("a chunk's checksum is wrong");
  std::string raw(raw_size, '\0');
  const size_t got = ZSTD_decompress(raw.data(), raw.size(), stored->data(), stored->size());
  if (ZSTD_isError(got) != 0 || got != raw_size) return Damaged("a chunk cannot be decompressed");
  std::vector<Block> blocks;
  ByteCursor columns(raw);
  for (uint32_t i = 0; i < count; ++i) {
    absl::StatusOr<Block> block = TakeBlock(&columns);
    if (!block.ok()) return Damaged(std::string(block.status().message()));
    if (last_.has_value() && block->key <= *last_) return Damaged("its blocks are out of order");
    last_ = block->key;
    ++blocks_;
    voxels_ += block->voxels.size();
    blocks.push_back(*std::move(block));
  }
  if (columns.left() > 0) return Damaged("a chunk holds more than its blocks");
  return blocks;
}

absl::Status ArchiveReader::CheckEnd() {
  const absl::StatusOr<std::string> bytes = ReadBytes(8 + 8 + 4);
  if (!bytes.ok()) return bytes.status();
  ByteCursor cursor(*bytes);
  const auto blocks = cursor.Take<uint64_t>(), voxels = cursor.Take<uint64_t>();
  if (cursor.Take<uint32_t>() != Crc32c(std::string_view(*bytes).substr(0, 16), Crc32c(std::string(1, kEndTag)))) {
    return Damaged("the end's checksum is wrong");
  }
  if (blocks != blocks_ || voxels != voxels_) return Damaged("blocks are missing");
  if (at_ != size_) return Damaged("something follows the end");
  return absl::OkStatus();
}

}  // namespace mapkeep
