#include "server/tiles/tile_source.h"

#include <absl/strings/str_cat.h>

#include <algorithm>

#include "core/tiling/gltf_points.h"
#include "core/tiling/thinning_levels.h"
#include "core/tiling/tile_pyramid.h"

namespace mapkeep {
namespace {

using Ticks = std::chrono::steady_clock;

constexpr auto kOpenFor = std::chrono::seconds(1);
constexpr size_t kMostOpened = 256;
constexpr int kWholeTile = -1;  // beside the levels: the making of an encoded tile

size_t BytesOf(const std::vector<TilePoint>& points) { return sizeof(points) + points.size() * sizeof(TilePoint); }

}  // namespace

TileSource::TileSource(const MapStore& maps, const TileSourceOptions& options)
    : maps_(maps),
      options_(options),
      reader_(maps, options.cache_bytes / 16),
      encoded_(options.cache_bytes / 8 * 5),
      kept_(options.cache_bytes / 4) {}

absl::StatusOr<std::shared_ptr<const EpochTiles>> TileSource::Open(const std::string& map,
                                                                   std::optional<uint64_t> epoch) {
  const auto snapshot = maps_.Open(map, epoch);
  if (!snapshot.ok()) return snapshot.status();
  std::shared_ptr<const EpochTiles> tiles = FindRecent((*snapshot)->map().incarnation, (*snapshot)->epoch());
  if (tiles == nullptr) {
    auto read = reader_.Read(**snapshot);
    if (!read.ok()) return read.status();
    tiles = *std::move(read);
  }
  NoteOpened(tiles);
  return tiles;
}

std::shared_ptr<const EpochTiles> TileSource::FindRecent(uint64_t incarnation, uint64_t epoch) {
  const std::scoped_lock lock(opened_mutex_);
  for (const auto& tiles : recent_) {
    if (tiles->incarnation == incarnation && tiles->epoch == epoch) return tiles;
  }
  return nullptr;
}

void TileSource::NoteOpened(const std::shared_ptr<const EpochTiles>& tiles) {
  const std::scoped_lock lock(opened_mutex_);
  std::erase(recent_, tiles);
  recent_.push_front(tiles);
  size_t bytes = 0, kept = 0;
  while (kept < recent_.size() && (bytes += recent_[kept]->bytes()) <= options_.cache_bytes / 16) ++kept;
  recent_.resize(std::max<size_t>(kept, 1));
  const Ticks::time_point now = Ticks::now();
  std::erase_if(opened_, [now](const auto& entry) { return entry.second.at + kOpenFor < now; });
  if (opened_.size() < kMostOpened) opened_[{tiles->map, tiles->epoch}] = {now, tiles};
}

std::shared_ptr<const EpochTiles> TileSource::FindOpen(const std::string& map, uint64_t epoch) {
  const std::scoped_lock lock(opened_mutex_);
  const auto found = opened_.find({map, epoch});
  if (found == opened_.end()) return nullptr;
  if (found->second.at + kOpenFor >= Ticks::now()) return found->second.tiles;
  opened_.erase(found);
  return nullptr;
}

SharedBytes TileSource::FindTile(const EpochTiles& tiles, size_t node, Coding coding) {
  return encoded_.Find({tiles.tiles[node], coding});
}

absl::StatusOr<SharedBytes> TileSource::Tile(const EpochTiles& tiles, size_t node, Coding coding) {
  return Keep(tiles.tiles[node], coding, [&] { return Encode(tiles, node); });
}

absl::StatusOr<SharedBytes> TileSource::Keep(const ContentId& id, Coding coding,
                                             const std::function<absl::StatusOr<std::string>()>& make) {
  const OneMaker maker(*this, {id, kWholeTile});
  if (SharedBytes known = encoded_.Find({id, coding})) return known;
  if (*held_ > 2 * options_.cache_bytes) {
    return absl::UnavailableError("too many slow clients hold tiles; try again");
  }
  std::string bytes;
  if (const SharedBytes plain = coding == Coding::kIdentity ? nullptr : encoded_.Find({id, Coding::kIdentity})) {
    bytes = Packed(*plain, coding);
  } else {
    absl::StatusOr<std::string> made = make();
    if (!made.ok()) return made.status();
    bytes = coding == Coding::kIdentity ? *std::move(made) : Packed(*made, coding);
  }
  const size_t size = bytes.size() + sizeof(std::string);
  SharedBytes shared = Counted(std::move(bytes));
  encoded_.Insert({id, coding}, shared, size);
  return shared;
}

SharedBytes TileSource::Counted(std::string bytes) {
  *held_ += bytes.size();
  const auto give_back = [held = held_](const std::string* gone) {
    *held -= gone->size();
    delete gone;
  };
  return {new const std::string(std::move(bytes)), give_back};
}

absl::StatusOr<std::string> TileSource::Encode(const EpochTiles& tiles, size_t node) {
  const auto snapshot = maps_.Open(tiles.map, tiles.epoch);
  if (!snapshot.ok()) return snapshot.status();
  if ((*snapshot)->map().incarnation != tiles.incarnation) {
    return absl::NotFoundError(absl::StrCat("map ", tiles.map, " was deleted"));
  }
  auto points = PointsOf(**snapshot, tiles, node);
  if (!points.ok()) return points.status();
  const std::optional<size_t> parent = tiles.tree[node].parent;
  const auto parent_level = parent ? std::optional(tiles.tree[*parent].id.level) : std::nullopt;
  const std::vector<TilePoint> shown = TileOf(*std::move(points), parent_level);
  ++tiles_made_;
  points_made_ += shown.size();
  return EncodePointTile(shown, {.voxel_size = tiles.voxel_size, .newest_day = tiles.newest_day});
}

absl::StatusOr<std::vector<TilePoint>> TileSource::PointsOf(const Snapshot& snapshot, const EpochTiles& tiles,
                                                            size_t node) {
  const TileNode& at = tiles.tree[node];
  if (at.children.empty()) return ReadPoints(snapshot, tiles, node);
  std::vector<TilePoint> points;
  for (const size_t child : at.children) {
    const absl::StatusOr<Points> kept = KeptOf(snapshot, tiles, child, at.id.level);
    if (!kept.ok()) return kept.status();
    points.insert(points.end(), (*kept)->begin(), (*kept)->end());
  }
  return points;
}

absl::StatusOr<TileSource::Points> TileSource::KeptOf(const Snapshot& snapshot, const EpochTiles& tiles, size_t node,
                                                      int level) {
  const KeptName name{tiles.nodes[node], level};
  const OneMaker maker(*this, name);
  if (Points known = kept_.Find(name)) return known;
  const absl::StatusOr<std::vector<TilePoint>> points = PointsOf(snapshot, tiles, node);
  if (!points.ok()) return points.status();
  auto kept = std::make_shared<std::vector<TilePoint>>(ThinToLevel(*points, level).kept);
  kept->shrink_to_fit();
  ++squares_made_;
  points_made_ += points->size();
  kept_.Insert(name, kept, BytesOf(*kept));
  return kept;
}

absl::StatusOr<std::vector<TilePoint>> TileSource::ReadPoints(const Snapshot& snapshot, const EpochTiles& tiles,
                                                              size_t node) {
  const TileNode& leaf = tiles.tree[node];
  std::vector<TilePoint> points;
  const size_t end = leaf.first_column + leaf.columns;
  for (size_t i = leaf.first_column; i < end;) {
    // Columns of one stored tile lie together.
    const auto tile = TileKeyOf(BlockKey{uint64_t{tiles.columns[i].key} << 16});
    const auto blocks = snapshot.BlockEntries(tile);
    if (!blocks.ok()) return blocks.status();
    for (const BlockEntry& block : *blocks) {
      if (block.static_voxels == 0) continue;
      while (i < end && tiles.columns[i].key < ColumnOf(block.key)) ++i;
      if (i == end || tiles.columns[i].key != ColumnOf(block.key)) continue;
      const auto read = snapshot.Read(block.key);
      if (!read.ok()) return read.status();
      AppendPoints(**read, options_.points, points);
    }
    while (i < end && TileKeyOf(BlockKey{uint64_t{tiles.columns[i].key} << 16}) == tile) ++i;
  }
  points_made_ += points.size();
  return points;
}

TileSourceCounts TileSource::counts() const { return {tiles_made_, points_made_, squares_made_}; }

}  // namespace mapkeep
