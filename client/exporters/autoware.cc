#include "client/exporters/autoware.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <array>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <map>
#include <string>
#include <system_error>
#include <utility>

#include "client/exporters/output_directory.h"

namespace mapkeep {
namespace {

static_assert(std::endian::native == std::endian::little, "the format is written little-endian");

namespace fs = std::filesystem;

constexpr int kCellMetres = 20;  // Autoware's own habit; whole metres, because its loader reads corners as such
constexpr size_t kMostWaiting = size_t{32} << 20;
constexpr size_t kWidestCount = std::numeric_limits<uint64_t>::digits10 + 1;

/// Of a length that does not depend on the count.
std::string HeaderOf(uint64_t count) {
  const std::string padding(2 * (kWidestCount - absl::StrCat(count).size()), ' ');
  return absl::StrFormat(
      "# .PCD v0.7 - Point Cloud Data file format%s\nVERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\n"
      "COUNT 1 1 1 1\nWIDTH %d\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS %d\nDATA binary\n",
      padding, count, count);
}

absl::Status CannotWrite(const fs::path& file) {
  return absl::UnknownError(
      absl::StrCat(file.string(), ": cannot be written: ", errno != 0 ? std::strerror(errno) : "the disk may be full"));
}

struct Cell {
  uint64_t count = 0;
  std::string waiting;  ///< points that are not in the file yet
};

using Corner = std::pair<int64_t, int64_t>;  ///< whole metres

class Autoware final : public MapExporter {
 public:
  Autoware(OutputDirectory directory, const ExportedMap& map, const ExportOptions& options)
      : directory_(std::move(directory)), map_(map), options_(options) {}

  absl::Status Add(const Block& block) override {
    ForEachPoint(block, map_.voxel_size, options_.detail, options_.box,
                 [this](const Eigen::Vector3d& point, const Voxel& voxel) {
                   const auto corner = [](double c) {
                     return static_cast<int64_t>(std::floor(c / kCellMetres)) * kCellMetres;
                   };
                   Cell& cell = cells_[{corner(point.x()), corner(point.y())}];
                   const std::array<float, 4> row = {static_cast<float>(point.x()), static_cast<float>(point.y()),
                                                     static_cast<float>(point.z()), IntensityOf(voxel)};
                   cell.waiting.append(reinterpret_cast<const char*>(row.data()), sizeof(row));
                   waiting_ += sizeof(row);
                   ++cell.count;
                   ++count_;
                 });
    return waiting_ < kMostWaiting ? absl::OkStatus() : Flush();
  }

  absl::Status Finish() override {
    if (absl::Status status = Flush(); !status.ok()) return status;
    for (const auto& [corner, cell] : cells_) {
      errno = 0;
      std::fstream file(FileOf(corner), std::ios::binary | std::ios::in | std::ios::out);
      file << HeaderOf(cell.count);
      file.close();
      if (!file) return CannotWrite(FileOf(corner));
    }
    std::string metadata = absl::StrFormat("x_resolution: %d.0\ny_resolution: %d.0\n", kCellMetres, kCellMetres);
    for (const auto& [corner, cell] : cells_) {
      absl::StrAppendFormat(&metadata, "%s: [%d, %d]\n", NameOf(corner), corner.first, corner.second);
    }
    absl::Status written = WriteText("pointcloud_map_metadata.yaml", metadata);
    written.Update(WriteText("map_projector_info.yaml", "projector_type: Local\n"));
    return written.ok() ? directory_.Finish() : written;
  }

 private:
  static std::string NameOf(const Corner& corner) { return absl::StrFormat("%d_%d.pcd", corner.first, corner.second); }
  fs::path FileOf(const Corner& corner) const { return directory_.path() / "pointcloud_map.pcd" / NameOf(corner); }

  absl::Status Flush() {
    std::error_code error;
    fs::create_directories(directory_.path() / "pointcloud_map.pcd", error);
    for (auto& [corner, cell] : cells_) {
      if (cell.waiting.empty()) continue;
      errno = 0;
      const bool is_new = cell.waiting.size() == cell.count * 4 * sizeof(float);
      std::ofstream file(FileOf(corner), std::ios::binary | std::ios::app);
      if (is_new) file << HeaderOf(0);
      file << cell.waiting;
      file.close();
      if (!file) return CannotWrite(FileOf(corner));
      std::string().swap(cell.waiting);
    }
    waiting_ = 0;
    return absl::OkStatus();
  }

  absl::Status WriteText(const char* name, const std::string& text) {
    errno = 0;
    std::ofstream file(directory_.path() / name, std::ios::binary);
    file << text;
    file.close();
    return file ? absl::OkStatus() : CannotWrite(directory_.path() / name);
  }

  OutputDirectory directory_;
  const ExportedMap map_;
  const ExportOptions options_;
  std::map<Corner, Cell> cells_;
  size_t waiting_ = 0;  ///< bytes
};

}  // namespace

absl::StatusOr<std::unique_ptr<MapExporter>> OpenAutoware(const fs::path& path, const ExportedMap& map,
                                                          const ExportOptions& options) {
  absl::StatusOr<OutputDirectory> directory = OutputDirectory::Create(path);
  if (!directory.ok()) return directory.status();
  return std::make_unique<Autoware>(*std::move(directory), map, options);
}

}  // namespace mapkeep
