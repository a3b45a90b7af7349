#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include "core/voxels/block.h"

namespace mapkeep {

// A map in one file, with everything that is known of its voxels (.mkmap). Numbers are little-endian.
//
//     archive := magic, header, chunk*, end
//     magic   := "MKMAP\x01\r\n"                             the byte 01 is the version
//     header  := f64 voxel size in metres, u8 has_origin, f64 origin[3], u16 n, u8 crs[n], u32 crc
//     chunk   := 'B', u32 blocks, u32 raw bytes, u32 stored bytes, u32 crc, u8 stored[stored bytes]    stored by zstd
//     raw     := block*
//     block   := i32 x, i32 y, i32 z, u32 voxels, then one column after the other, an entry a voxel:
//                u16 position, u16 hits, u16 exposures, u8 flags (1 ground, 2 static, 4 new), u8 mean[3], u8 normal[2],
//                u8 intensity, u64 mask, u32 first_seen, u32 last_seen
//     end     := 'E', u64 blocks, u64 voxels, u32 crc
//
// Checksums are CRC-32C: of the header's and the end's bytes before them, and of a chunk's stored bytes. Blocks are in
// order of their keys, none twice. Nothing says when the archive was made, or of which epoch: equal maps, equal bytes.

/// What an archive says of the map as a whole.
struct ArchiveHeader {
  double voxel_size = 0;                  ///< metres
  std::optional<Eigen::Vector3d> origin;  ///< metres
  std::string crs;                        ///< "EPSG:N" or empty

  bool operator==(const ArchiveHeader&) const = default;
};

/// Writes an archive to a stream in constant memory. What goes wrong shows in the stream's state.
class ArchiveWriter {
 public:
  /// The stream outlives the writer.
  ArchiveWriter(std::ostream& stream, const ArchiveHeader& header);

  /// Blocks in order of key; an empty one is left out.
  absl::Status Add(const Block& block);
  absl::Status Finish();

  uint64_t voxels() const { return voxels_; }

 private:
  absl::Status WriteChunk();

  std::ostream& stream_;
  std::string raw_;
  uint32_t raw_blocks_ = 0;
  uint64_t blocks_ = 0, voxels_ = 0;
  std::optional<BlockKey> last_;
};

/// Reads an archive in constant memory. Every error is INVALID_ARGUMENT or DATA_LOSS and begins with the file.
class ArchiveReader {
 public:
  static absl::StatusOr<ArchiveReader> Open(const std::filesystem::path& path);

  const ArchiveHeader& header() const { return header_; }

  /// The next blocks, in order of key; none: the archive has ended, and was whole.
  absl::StatusOr<std::vector<Block>> Next();

  /// Bytes read, of all: for progress.
  double fraction() const { return size_ == 0 ? 1 : static_cast<double>(at_) / static_cast<double>(size_); }
  uint64_t voxels() const { return voxels_; }

 private:
  ArchiveReader(std::filesystem::path path, std::ifstream stream, uint64_t size)
      : path_(std::move(path)), stream_(std::move(stream)), size_(size) {}

  absl::Status ReadHeader();
  absl::Status CheckEnd();
  absl::Status Damaged(std::string_view what) const;
  absl::StatusOr<std::string> ReadBytes(size_t count);

  std::filesystem::path path_;
  std::ifstream stream_;
  uint64_t size_ = 0, at_ = 0;
  ArchiveHeader header_;
  uint64_t blocks_ = 0, voxels_ = 0;
  std::optional<BlockKey> last_;
};

}  // namespace mapkeep
