#include "client/exporters/compressed_pcd.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <pcl/io/lzf.h>

#include <array>
#include <bit>
#include <cstring>
#include <limits>
#include <utility>

#include "client/exporters/output_file.h"
#include "client/exporters/spool_file.h"

namespace mapkeep {
namespace {

static_assert(std::endian::native == std::endian::little, "the format is written little-endian");

constexpr size_t kPiece = size_t{1} << 20;
constexpr size_t kMostExpanded = kPiece + kPiece / 16 + 64;  ///< LZF's worst case is 33/32

class CompressedPcd final : public MapExporter {
 public:
  CompressedPcd(OutputFile file, std::vector<SpoolFile> columns, const ExportedMap& map, const ExportOptions& options,
                const std::vector<std::string>& comments)
      : file_(std::move(file)), columns_(std::move(columns)), map_(map), options_(options), comments_(comments) {
    if (options.absolute) shift_ = map.OriginOrZero();
  }

  absl::Status Add(const Block& block) override {
    absl::Status status;
    ForEachPoint(block, map_.voxel_size, options_.detail, options_.box,
                 [&](const Eigen::Vector3d& point, const Voxel& voxel) {
                   const Eigen::Vector3d position = point + shift_;
                   for (int axis = 0; axis < 3; ++axis) {
                     if (options_.absolute) {
                       status.Update(Put(axis, position[axis]));
                     } else {
                       status.Update(Put(axis, static_cast<float>(position[axis])));
                     }
                   }
                   status.Update(Put(3, IntensityOf(voxel)));
                   ++count_;
                 });
    return status;
  }

  absl::Status Finish() override {
    uint64_t bytes = 0;
    for (const SpoolFile& column : columns_) bytes += column.size();
    if (bytes > std::numeric_limits<uint32_t>::max()) {
      return absl::OutOfRangeError(
          absl::StrFormat("a compressed PCD file holds at most 4 GiB of points, the map has %d points: leave "
                          "--compressed out, or cut with --box",
                          count_));
    }
    std::ostream& stream = file_.stream();
    const int size = options_.absolute ? 8 : 4;
    stream << "# .PCD v0.7 - Point Cloud Data file format\n";
    for (const std::string& comment : comments_) stream << "# " << comment << '\n';
    stream << absl::StrFormat(
        "VERSION 0.7\nFIELDS x y z intensity\nSIZE %d %d %d 4\nTYPE F F F F\nCOUNT 1 1 1 1\n"
        "WIDTH %d\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS %d\nDATA binary_compressed\n",
        size, size, size, count_, count_);
    const std::streampos sizes = stream.tellp();
    PutSizes(0, 0);
    uint64_t compressed = 0;
    for (SpoolFile& column : columns_) {
      if (absl::Status status = Compress(column, &compressed); !status.ok()) return status;
    }
    if (compressed > std::numeric_limits<uint32_t>::max()) {
      return absl::OutOfRangeError("the points grow beyond 4 GiB when they are compressed: leave --compressed out");
    }
    stream.seekp(sizes);
    PutSizes(static_cast<uint32_t>(compressed), static_cast<uint32_t>(bytes));
    return file_.Finish();
  }

 private:
  template <typename Number>
  absl::Status Put(size_t column, Number number) {
    return columns_[column].Append({reinterpret_cast<const char*>(&number), sizeof(number)});
  }

  void PutSizes(uint32_t compressed, uint32_t bytes) {
    const std::array<uint32_t, 2> sizes = {compressed, bytes};
    file_.stream().write(reinterpret_cast<const char*>(sizes.data()), sizeof(sizes));
  }

  absl::Status Compress(SpoolFile& column, uint64_t* compressed) {
    std::string piece(kPiece, '\0'), out(kMostExpanded, '\0');
    for (uint64_t at = 0; at < column.size(); at += kPiece) {
      const size_t count = std::min<uint64_t>(kPiece, column.size() - at);
      if (absl::Status status = column.Read(at, piece.data(), count); !status.ok()) return status;
      const unsigned int got = pcl::lzfCompress(piece.data(), static_cast<unsigned int>(count), out.data(),
                                                static_cast<unsigned int>(out.size()));
      if (got == 0) return absl::InternalError("LZF could not compress a piece of the points");
      file_.stream().write(out.data(), got);
      *compressed += got;
    }
    return absl::OkStatus();
  }

  OutputFile file_;
  std::vector<SpoolFile> columns_;
  const ExportedMap map_;
  const ExportOptions options_;
  const std::vector<std::string> comments_;
  Eigen::Vector3d shift_ = Eigen::Vector3d::Zero();
};

}  // namespace

absl::StatusOr<std::unique_ptr<MapExporter>> OpenCompressedPcd(const std::filesystem::path& path,
                                                               const ExportedMap& map, const ExportOptions& options,
                                                               const std::vector<std::string>& comments) {
  absl::StatusOr<OutputFile> file = OutputFile::Create(path);
  if (!file.ok()) return file.status();
  std::vector<SpoolFile> columns;
  for (int i = 0; i < 4; ++i) {
    absl::StatusOr<SpoolFile> column = SpoolFile::Create(path);
    if (!column.ok()) return column.status();
    columns.push_back(*std::move(column));
  }
  return std::make_unique<CompressedPcd>(*std::move(file), std::move(columns), map, options, comments);
}

}  // namespace mapkeep
