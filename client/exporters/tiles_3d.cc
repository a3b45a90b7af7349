#include "client/exporters/tiles_3d.h"

#include <absl/strings/str_cat.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "client/exporters/output_directory.h"
#include "client/exporters/spooled_points.h"
#include "core/tiling/gltf_points.h"
#include "core/tiling/tile_pyramid.h"
#include "core/tiling/tileset_json.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

std::string FileOf(const TileNodeId& node) { return absl::StrCat("tiles/", NameOf(node), ".glb"); }

absl::Status WriteFile(const fs::path& file, const std::string& bytes) {
  errno = 0;
  std::ofstream stream(file, std::ios::binary);
  stream << bytes;
  stream.close();
  if (stream) return absl::OkStatus();
  return absl::UnknownError(
      absl::StrCat(file.string(), ": cannot be written: ", errno != 0 ? std::strerror(errno) : "the disk may be full"));
}

class Tiles3d final : public MapExporter {
 public:
  Tiles3d(OutputDirectory directory, SpooledPoints points, const ExportedMap& map, const ExportOptions& options)
      : directory_(std::move(directory)),
        points_(std::move(points)),
        map_(map),
        options_(options),
        pyramid_({.static_only = false},
                 [this](const TileNodeId& node, std::span<const TilePoint> points) { return Keep(node, points); }) {}

  absl::Status Add(const Block& block) override {
    points_.See(block);
    const Block selected = Selected(block, map_.voxel_size, options_);
    return selected.voxels.empty() ? absl::OkStatus() : pyramid_.Add(selected);
  }

  absl::Status Finish() override {
    const absl::StatusOr<std::vector<TileNode>> nodes = pyramid_.Finish();
    if (!nodes.ok()) return nodes.status();
    std::error_code error;
    fs::create_directories(directory_.path() / "tiles", error);
    for (const auto& [node, part] : tiles_) {
      const absl::StatusOr<std::vector<TilePoint>> points = points_.Read(part);
      if (!points.ok()) return points.status();
      const std::string tile =
          EncodePointTile(*points, {.voxel_size = map_.voxel_size, .newest_day = points_.newest_day()});
      if (absl::Status status = WriteFile(directory_.path() / FileOf(node), tile); !status.ok()) return status;
    }
    const std::string tileset = TilesetJson(
        *nodes, 0, {.voxel_size = map_.voxel_size, .tile_uri = [](const TileNode& node) { return FileOf(node.id); }});
    if (absl::Status status = WriteFile(directory_.path() / "tileset.json", tileset); !status.ok()) return status;
    return directory_.Finish();
  }

 private:
  absl::Status Keep(const TileNodeId& node, std::span<const TilePoint> points) {
    const absl::StatusOr<SpooledPoints::Part> part = points_.Add(points);
    if (!part.ok()) return part.status();
    tiles_.emplace_back(node, *part);
    count_ += points.size();
    return absl::OkStatus();
  }

  OutputDirectory directory_;
  SpooledPoints points_;
  const ExportedMap map_;
  const ExportOptions options_;
  TilePyramid pyramid_;
  std::vector<std::pair<TileNodeId, SpooledPoints::Part>> tiles_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<MapExporter>> OpenTiles3d(const fs::path& path, const ExportedMap& map,
                                                         const ExportOptions& options) {
  absl::StatusOr<OutputDirectory> directory = OutputDirectory::Create(path);
  if (!directory.ok()) return directory.status();
  absl::StatusOr<SpooledPoints> points = SpooledPoints::Create(directory->path());
  if (!points.ok()) return points.status();
  return std::make_unique<Tiles3d>(*std::move(directory), *std::move(points), map, options);
}

}  // namespace mapkeep
