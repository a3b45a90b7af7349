#include "core/tiling/tileset_json.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>

namespace mapkeep {
namespace {

constexpr double kErrorByCell = 8;

double CellOf(int level, double voxel_size) { return std::ldexp(voxel_size / 4, level); }

// Centre, then half of each axis.
std::string Volume(const TileBounds& bounds, double voxel_size) {
  const double size = voxel_size * kBlockSize;
  const Eigen::Vector3d low = CornerOf(bounds.first, size);
  const Eigen::Vector3d high = CornerOf({bounds.last.x + 1, bounds.last.y + 1, bounds.last.z + 1}, size);
  const Eigen::Vector3d centre = (low + high) / 2, half = (high - low) / 2;
  return absl::StrFormat(R"({"box":[%.12g,%.12g,%.12g,%.12g,0,0,0,%.12g,0,0,0,%.12g]})", centre.x(), centre.y(),
                         centre.z(), half.x(), half.y(), half.z());
}

void AppendTile(std::span<const TileNode> nodes, size_t index, int depth, const TilesetOptions& options,
                std::string& json) {
  const TileNode& node = nodes[index];
  const bool elsewhere = options.tileset_uri && depth > options.depth && !node.children.empty();
  absl::StrAppendFormat(&json, R"({"boundingVolume":%s,"geometricError":%.12g,"refine":"ADD","content":{"uri":"%s"})",
                        Volume(node.bounds, options.voxel_size), GeometricError(node, options.voxel_size),
                        elsewhere ? options.tileset_uri(node) : options.tile_uri(node));
  if (!elsewhere && !node.children.empty()) {
    json += R"(,"children":[)";
    for (size_t i = 0; i < node.children.size(); ++i) {
      if (i > 0) json += ',';
      AppendTile(nodes, node.children[i], depth + 1, options, json);
    }
    json += ']';
  }
  json += '}';
}

}  // namespace

double GeometricError(const TileNode& node, double voxel_size) {
  return node.children.empty() ? 0 : kErrorByCell * CellOf(node.id.level, voxel_size);
}

std::string TilesetJson(std::span<const TileNode> nodes, size_t root, const TilesetOptions& options) {
  std::string json = R"({"asset":{"version":"1.1"},)";
  if (!options.extras.empty()) absl::StrAppend(&json, R"("extras":)", options.extras, ",");
  if (nodes.empty()) {
    return absl::StrCat(json, R"("geometricError":0,"root":{"boundingVolume":{"box":[0,0,0,1,0,0,0,1,0,0,0,1]},)",
                        R"("geometricError":0,"refine":"ADD"}})");
  }
  // What a viewer misses that shows nothing at all: as much as the size of it.
  const TileBounds& bounds = nodes[root].bounds;
  const int blocks =
      std::max({bounds.last.x - bounds.first.x, bounds.last.y - bounds.first.y, bounds.last.z - bounds.first.z}) + 1;
  const double all =
      std::max(GeometricError(nodes[root], options.voxel_size), blocks * kBlockSize * options.voxel_size);
  absl::StrAppendFormat(&json, R"("geometricError":%.12g,"root":)", all);
  AppendTile(nodes, root, 0, options, json);
  json += '}';
  return json;
}

}  // namespace mapkeep
