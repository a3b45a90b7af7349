#include "server/http/tile_pages.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>

#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "core/tiling/tileset_json.h"
#include "server/http/content_coding.h"

namespace mapkeep {
namespace {

constexpr size_t kMostInOneFile = 4096;  // tiles; a larger tileset is divided
constexpr int kDepthOfAFile = 4;

// What a tileset of a collected epoch is for those who ask over HTTP.
absl::StatusOr<PageResponse> Gone(const absl::Status& status) {
  if (!absl::IsFailedPrecondition(status)) return status;
  return ErrorPage(410, "FAILED_PRECONDITION", std::string(status.message()));
}

std::string ExtrasOf(const EpochTiles& tiles) {
  nlohmann::json about = {{"map", tiles.map},
                          {"epoch", tiles.epoch},
                          {"voxelSize", tiles.voxel_size},
                          {"newestDay", tiles.newest_day},
                          {"crs", tiles.crs}};
  if (tiles.origin) about["origin"] = {tiles.origin->x(), tiles.origin->y(), tiles.origin->z()};
  return nlohmann::json{{"mapkeep", about}}.dump();
}

std::string FileOf(const EpochTiles& tiles, const TileNode& node, const char* ending) {
  const size_t index = static_cast<size_t>(&node - tiles.tree.data());
  // Of a part of a tileset the id says which points are below it; of a tile, what its bytes are.
  const ContentId& id = ending == std::string("json") ? tiles.nodes[index] : tiles.tiles[index];
  return absl::StrCat(NameOf(node.id), ".", id.Hex(), ".", ending);
}

// The tileset below a node, in a file from which tiles are found below `path`.
std::string Tileset(const EpochTiles& tiles, size_t root, const std::string& path) {
  TilesetOptions options{.voxel_size = tiles.voxel_size, .depth = kDepthOfAFile, .extras = ExtrasOf(tiles)};
  options.tile_uri = [&](const TileNode& node) { return path + FileOf(tiles, node, "glb"); };
  if (tiles.tree.size() > kMostInOneFile) {
    options.tileset_uri = [&](const TileNode& node) { return path + FileOf(tiles, node, "json"); };
  }
  return TilesetJson(tiles.tree, root, options);
}

// What is sent for bytes that have an id, in the coding that the client likes.
struct Representation {
  ContentId id;
  std::string content_type;
  Keep keep = Keep::kForever;
};

Coding CodingFor(const PageRequest& request) {
  // A part of a body is a part of the plain one.
  return request.range.empty() ? BestCoding(request.accept_encoding) : Coding::kIdentity;
}

PageResponse Page(const PageRequest& request, const Representation& what, Coding coding, SharedBytes bytes) {
  PageResponse page{.content_type = what.content_type,
                    .content_coding = NameOf(coding),
                    .body = std::move(bytes),
                    .etag = EntityTag(what.id.Hex(), coding),
                    .keep = what.keep};
  ApplyRange(request, page);
  return page;
}

// The answer if the client has it already.
std::optional<PageResponse> Unchanged(const PageRequest& request, const Representation& what, Coding coding) {
  std::string etag = EntityTag(what.id.Hex(), coding);
  if (!NamesTag(request.if_none_match, etag)) return {};
  return PageResponse{.status = 304, .etag = std::move(etag), .keep = what.keep};
}

// "2_0_-1.glb" or "2_0_-1.<id>.glb".
struct FileName {
  std::optional<TileNodeId> node;
  std::string id, ending;
};

FileName Parse(const std::string& file) {
  const std::vector<std::string> parts = absl::StrSplit(file, '.');
  if (parts.size() != 2 && parts.size() != 3) return {};
  return {TileNodeNamed(parts[0]), parts.size() == 3 ? parts[1] : "", parts.back()};
}

}  // namespace

absl::StatusOr<PageResponse> TilesetPage(const PageContext& context, const PageRequest& request, const std::string& map,
                                         std::optional<uint64_t> epoch) {
  const auto tiles = context.tiles.Open(map, epoch);
  if (!tiles.ok()) return Gone(tiles.status());
  const std::string path = epoch ? "tiles/" : absl::StrCat("../epochs/", (*tiles)->epoch, "/tiles/");
  const Representation what{ContentIdMaker().Add((*tiles)->all).Add(epoch ? 1 : 0).id(), "application/json",
                            epoch ? Keep::kForever : Keep::kRevalidate};
  const Coding coding = CodingFor(request);
  if (auto unchanged = Unchanged(request, what, coding)) return *std::move(unchanged);
  auto bytes =
      context.tiles.Keep(what.id, coding, [&]() -> absl::StatusOr<std::string> { return Tileset(**tiles, 0, path); });
  if (!bytes.ok()) return bytes.status();
  return Page(request, what, coding, *std::move(bytes));
}

std::optional<absl::StatusOr<PageResponse>> TileFilePage(const PageContext& context, const PageRequest& request,
                                                         const std::string& map, uint64_t epoch,
                                                         const std::string& file, bool only_memory) {
  std::shared_ptr<const EpochTiles> tiles = context.tiles.FindOpen(map, epoch);
  if (tiles == nullptr) {
    if (only_memory) return {};
    auto opened = context.tiles.Open(map, epoch);
    if (!opened.ok()) return Gone(opened.status());
    tiles = *std::move(opened);
  }
  const FileName name = Parse(file);
  const std::optional<size_t> node = name.node ? tiles->Find(*name.node) : std::nullopt;
  const bool is_tile = name.ending == "glb";
  if (!node || (!is_tile && name.ending != "json")) {
    // What memory still holds of an epoch must not hide that the epoch was collected.
    if (only_memory) return {};
    if (const auto opened = context.tiles.Open(map, epoch); !opened.ok()) return Gone(opened.status());
    return absl::NotFoundError(absl::StrCat("epoch ", epoch, " has no tile ", file));
  }
  const ContentId& of_name = is_tile ? tiles->tiles[*node] : tiles->nodes[*node];
  if (!name.id.empty() && name.id != of_name.Hex()) {
    return absl::NotFoundError(absl::StrCat("epoch ", epoch, " has another tile than ", file));
  }
  Representation what{tiles->tiles[*node], "model/gltf-binary"};
  if (!is_tile) what = {ContentIdMaker().Add(tiles->all).Add(of_name).id(), "application/json"};
  const Coding coding = CodingFor(request);
  if (auto unchanged = Unchanged(request, what, coding)) return *std::move(unchanged);
  if (SharedBytes known = context.tiles.Find(what.id, coding)) return Page(request, what, coding, std::move(known));
  if (only_memory) return {};
  auto bytes = is_tile ? context.tiles.Tile(*tiles, *node, coding)
                       : context.tiles.Keep(what.id, coding, [&]() -> absl::StatusOr<std::string> {
                           return Tileset(*tiles, *node, "");
                         });
  if (!bytes.ok()) return Gone(bytes.status());
  return Page(request, what, coding, *std::move(bytes));
}

}  // namespace mapkeep
