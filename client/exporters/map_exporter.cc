#include "client/exporters/map_exporter.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <utility>

#include "client/exporters/archive_exporter.h"
#include "client/exporters/autoware.h"
#include "client/exporters/compressed_pcd.h"
#include "client/exporters/glb.h"
#include "client/exporters/las.h"
#include "client/exporters/octomap_file.h"
#include "client/exporters/point_file.h"
#include "client/exporters/tiles_3d.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

/// What a reader needs to place the points.
std::vector<std::string> CommentsOf(const ExportedMap& map, bool absolute) {
  const Eigen::Vector3d origin = map.OriginOrZero();
  std::vector<std::string> comments = {absl::StrFormat("origin %.3f %.3f %.3f %s", origin.x(), origin.y(), origin.z(),
                                                       absolute ? "added" : "not added")};
  if (!map.crs.empty()) comments.push_back(absl::StrCat("crs ", map.crs));
  return comments;
}

/// PCD and PLY.
class PointFileExporter final : public MapExporter {
 public:
  PointFileExporter(PointFileWriter writer, const ExportedMap& map, const ExportOptions& options)
      : writer_(std::move(writer)), map_(map), options_(options) {
    if (options.absolute) shift_ = map.OriginOrZero();
  }

  absl::Status Add(const Block& block) override {
    ForEachPoint(
        block, map_.voxel_size, options_.detail, options_.box,
        [this](const Eigen::Vector3d& point, const Voxel& voxel) { writer_.Add(point + shift_, IntensityOf(voxel)); });
    count_ = writer_.count();
    return absl::OkStatus();
  }

  absl::Status Finish() override { return writer_.Finish(); }

 private:
  PointFileWriter writer_;
  const ExportedMap map_;
  const ExportOptions options_;
  Eigen::Vector3d shift_ = Eigen::Vector3d::Zero();
};

absl::StatusOr<std::unique_ptr<MapExporter>> OpenPointFile(const fs::path& path, PointFileFormat format,
                                                           const ExportedMap& map, const ExportOptions& options) {
  const CoordinateType type = options.absolute ? CoordinateType::kFloat64 : CoordinateType::kFloat32;
  auto writer = PointFileWriter::Create(path, format, type, CommentsOf(map, options.absolute));
  if (!writer.ok()) return writer.status();
  return std::make_unique<PointFileExporter>(*std::move(writer), map, options);
}

}  // namespace

const std::vector<ExportFormatInfo>& ExportFormats() {
  static const auto* const formats = new std::vector<ExportFormatInfo>{
      {ExportFormat::kPcd, "pcd", ".pcd", "points for PCL"},
      {ExportFormat::kPly, "ply", ".ply", "points for mesh tools"},
      {ExportFormat::kLas, "las", ".las", "LAS 1.4 in the map's CRS"},
      {.format = ExportFormat::kAutoware,
       .name = "autoware",
       .what = "directory of PCD cells and their metadata",
       .can_be_absolute = false},
      {.format = ExportFormat::kOctoMap,
       .name = "bt",
       .suffix = ".bt",
       .what = "OctoMap's binary occupancy tree",
       .can_be_absolute = false},
      {.format = ExportFormat::kGlb,
       .name = "glb",
       .suffix = ".glb",
       .what = "glTF 2.0 points",
       .can_be_absolute = false},
      {.format = ExportFormat::kTiles3d,
       .name = "3dtiles",
       .what = "directory of OGC 3D Tiles 1.1",
       .can_be_absolute = false},
      {.format = ExportFormat::kArchive,
       .name = "mkmap",
       .suffix = ".mkmap",
       .what = "everything, for mapkeep import",
       .whole_voxels = true,
       .can_be_absolute = false},
  };
  return *formats;
}

const ExportFormatInfo& InfoOf(ExportFormat format) {
  return *std::ranges::find(ExportFormats(), format, &ExportFormatInfo::format);
}

absl::StatusOr<ExportFormat> ExportFormatOf(const fs::path& path, std::string_view name) {
  for (const ExportFormatInfo& info : ExportFormats()) {
    if (name.empty() ? !info.suffix.empty() && path.extension() == info.suffix : info.name == name) return info.format;
  }
  const std::string known = absl::StrJoin(ExportFormats(), ", ", [&](std::string* out, const ExportFormatInfo& info) {
    absl::StrAppend(out, std::string(name.empty() && !info.suffix.empty() ? info.suffix : info.name));
  });
  if (!name.empty()) {
    return absl::InvalidArgumentError(
        absl::StrFormat("no export format is called '%s': expected one of %s", name, known));
  }
  return absl::InvalidArgumentError(
      absl::StrFormat("%s: its suffix tells no format: expected one of %s, or --format", path.string(), known));
}

absl::StatusOr<std::unique_ptr<MapExporter>> OpenExporter(ExportFormat format, const fs::path& path,
                                                          const ExportedMap& map, const ExportOptions& options) {
  const ExportFormatInfo& info = InfoOf(format);
  if (options.compressed && format != ExportFormat::kPcd) {
    return absl::InvalidArgumentError("--compressed is for PCD files");
  }
  if (options.absolute && !info.can_be_absolute) {
    return absl::InvalidArgumentError(
        absl::StrFormat("%s holds coordinates relative to the map's origin: --absolute is not for it", info.name));
  }
  switch (format) {
    case ExportFormat::kPcd:
      if (options.compressed) return OpenCompressedPcd(path, map, options, CommentsOf(map, options.absolute));
      return OpenPointFile(path, PointFileFormat::kPcd, map, options);
    case ExportFormat::kPly:
      return OpenPointFile(path, PointFileFormat::kPly, map, options);
    case ExportFormat::kLas:
      return OpenLas(path, map, options);
    case ExportFormat::kAutoware:
      return OpenAutoware(path, map, options);
    case ExportFormat::kOctoMap:
      return OpenOctoMapFile(path, map, options);
    case ExportFormat::kGlb:
      return OpenGlb(path, map, options);
    case ExportFormat::kTiles3d:
      return OpenTiles3d(path, map, options);
    case ExportFormat::kArchive:
      return OpenArchiveExporter(path, map);
  }
  return absl::InternalError("unknown export format");
}

}  // namespace mapkeep
