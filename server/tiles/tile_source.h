#pragma once

#include <absl/container/flat_hash_set.h>
#include <absl/status/statusor.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/tiling/tile_point.h"
#include "server/tiles/epoch_tiles.h"
#include "server/tiles/packing.h"
#include "storage/byte_cache.h"
#include "storage/map_store.h"

namespace mapkeep {

/// Bytes that are shared by all who send them.
using SharedBytes = std::shared_ptr<const std::string>;

struct TileSourceOptions {
  size_t cache_bytes = size_t{256} << 20;  ///< of tiles as they are sent, and of what larger tiles are made of
  PointSelection points;
};

/// What was made; for tests and measurements of how much an epoch costs.
struct TileSourceCounts {
  uint64_t tiles = 0;    ///< encoded
  uint64_t points = 0;   ///< read from blocks, thinned or encoded
  uint64_t squares = 0;  ///< nodes whose points were thinned for the level above
};

/// Makes the tiles of maps, and keeps them by the identity of what they are made of: what an epoch did not change is
/// not made again for it. Thread-safe; what several threads ask for at a time is made once.
class TileSource {
 public:
  /// `maps` outlives it.
  TileSource(const MapStore& maps, const TileSourceOptions& options);

  /// The levels of detail of the newest epoch, or a given one. Reads the store. Errors as of MapStore::Open.
  absl::StatusOr<std::shared_ptr<const EpochTiles>> Open(const std::string& map, std::optional<uint64_t> epoch);
  /// Those of an epoch that was opened less than a second ago, or nullptr. Does not block.
  std::shared_ptr<const EpochTiles> FindOpen(const std::string& map, uint64_t epoch);

  /// A tile's bytes. Reads the store. RESOURCE_EXHAUSTED while slow clients hold more than the cache may.
  absl::StatusOr<SharedBytes> Tile(const EpochTiles& tiles, size_t node, Coding coding);
  /// The same if it is in memory, or nullptr. Does not block.
  SharedBytes FindTile(const EpochTiles& tiles, size_t node, Coding coding);

  /// Packs bytes that somebody made, and keeps them. As Tile.
  absl::StatusOr<SharedBytes> Keep(const ContentId& id, Coding coding,
                                   const std::function<absl::StatusOr<std::string>()>& make);
  SharedBytes Find(const ContentId& id, Coding coding) { return encoded_.Find({id, coding}); }

  TileSourceCounts counts() const;
  /// Of tiles as they are sent, and of the points that larger tiles are made of.
  CacheUse encoded_use() const { return encoded_.Use(); }
  CacheUse kept_use() const { return kept_.Use(); }

 private:
  using Points = std::shared_ptr<const std::vector<TilePoint>>;
  using EncodedName = std::pair<ContentId, Coding>;
  using KeptName = std::pair<ContentId, int>;  // of a node, and the level that keeps

  // While one lives, whoever else wants to make the same waits, and then finds it made. What is waited for never waits
  // for what waits: a square needs only those inside it.
  class OneMaker {
   public:
    OneMaker(TileSource& source, KeptName name) : source_(source), name_(std::move(name)) {
      std::unique_lock lock(source_.making_mutex_);
      source_.made_.wait(lock, [this] { return source_.making_.insert(name_).second; });
    }
    ~OneMaker() {
      const std::scoped_lock lock(source_.making_mutex_);
      source_.making_.erase(name_);
      source_.made_.notify_all();
    }
    OneMaker(const OneMaker&) = delete;
    OneMaker& operator=(const OneMaker&) = delete;

   private:
    TileSource& source_;
    const KeptName name_;
  };

  std::shared_ptr<const EpochTiles> FindRecent(uint64_t incarnation, uint64_t epoch);
  void NoteOpened(const std::shared_ptr<const EpochTiles>& tiles);
  absl::StatusOr<std::vector<TilePoint>> PointsOf(const Snapshot& snapshot, const EpochTiles& tiles, size_t node);
  absl::StatusOr<Points> KeptOf(const Snapshot& snapshot, const EpochTiles& tiles, size_t node, int level);
  absl::StatusOr<std::vector<TilePoint>> ReadPoints(const Snapshot& snapshot, const EpochTiles& tiles, size_t node);
  absl::StatusOr<std::string> Encode(const EpochTiles& tiles, size_t node);
  SharedBytes Counted(std::string bytes);

  const MapStore& maps_;
  const TileSourceOptions options_;
  EpochTilesReader reader_;
  ByteCache<EncodedName, std::string> encoded_;
  ByteCache<KeptName, std::vector<TilePoint>> kept_;

  struct Opened {
    std::chrono::steady_clock::time_point at;
    std::shared_ptr<const EpochTiles> tiles;
  };
  std::mutex opened_mutex_;
  std::deque<std::shared_ptr<const EpochTiles>> recent_;  // the one used last first
  std::map<std::pair<std::string, uint64_t>, Opened> opened_;

  std::mutex making_mutex_;
  std::condition_variable made_;
  absl::flat_hash_set<KeptName> making_;

  std::shared_ptr<std::atomic<size_t>> held_ = std::make_shared<std::atomic<size_t>>(0);
  std::atomic<uint64_t> tiles_made_ = 0, points_made_ = 0, squares_made_ = 0;
};

}  // namespace mapkeep
