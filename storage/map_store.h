#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/geometry/progress.h"
#include "core/voxels/block.h"
#include "core/voxels/voxel_index.h"
#include "storage/cache_use.h"
#include "storage/clock.h"
#include "storage/engine.h"
#include "storage/write_id.h"

namespace mapkeep {

/// What a map is, apart from its content.
struct MapRecord {
  std::string name;
  uint64_t incarnation = 0;               ///< random; tells a map from an earlier one of the same name
  double voxel_size = 0.2;                ///< metres
  std::optional<Eigen::Vector3d> origin;  ///< of the map's coordinates in the robots' frame, metres; see Map.origin
  std::string crs;                        ///< "EPSG:N" or empty
  double created = 0;                     ///< seconds since 1970 (UTC)
};

/// Sums over the map's blocks, kept in the tree so that they cost nothing to read.
struct MapTotals {
  uint64_t voxels = 0, static_voxels = 0, blocks = 0, tiles = 0;
  bool operator==(const MapTotals&) const = default;
};

/// Axis-aligned range of blocks, both ends inclusive.
struct BlockRange {
  VoxelIndex first, last;
};

/// A tile at one epoch, without its content.
struct TileEntry {
  TileKey key{};
  WriteId version;  ///< of the value that names the tile's blocks: another one whenever one of them changed
  MapTotals totals;
};

/// A block at one epoch, without its content.
struct BlockEntry {
  BlockKey key{};
  WriteId version;  ///< two contents of one block never share one
  uint64_t static_voxels = 0;
};

/// One epoch of one map, pinned while this lives: what it reads does not change and is not collected. Thread-safe.
/// The store outlives it. A process that slept past its pin gets FAILED_PRECONDITION for what was collected meanwhile.
class Snapshot final {
 public:
  struct State;
  explicit Snapshot(std::unique_ptr<const State> state);
  ~Snapshot();
  Snapshot(const Snapshot&) = delete;
  Snapshot& operator=(const Snapshot&) = delete;

  uint64_t epoch() const;
  const MapRecord& map() const;
  const MapTotals& totals() const;
  /// Sessions merged up to this epoch.
  uint64_t sessions() const;
  /// Smallest range of blocks that holds the map, to whole tiles in x and y; nothing while it is empty.
  std::optional<BlockRange> bounds() const;

  /// The block, or nullptr if the map has none there. DATA_LOSS naming the block if its value is damaged or missing.
  absl::StatusOr<std::shared_ptr<const Block>> Read(BlockKey key) const;

  /// Tiles with at least one block whose column touches the range (everything: no range), in key order.
  absl::StatusOr<std::vector<TileKey>> Tiles(const std::optional<BlockRange>& range) const;

  /// Tiles that hold static voxels and whose columns touch the range (everything: no range), in key order. A tile that
  /// no commit changed has the same version at every epoch, also after a rollback; two contents never share one.
  absl::StatusOr<std::vector<TileEntry>> TileEntries(const std::optional<BlockRange>& range) const;

  /// The tile's entry, or nothing if it holds no static voxel.
  absl::StatusOr<std::optional<TileEntry>> FindTile(TileKey tile) const;

  /// Keys of the blocks of a tile, in order.
  absl::StatusOr<std::vector<BlockKey>> BlocksOf(TileKey tile) const;

  /// Likewise with their versions; reads no block.
  absl::StatusOr<std::vector<BlockEntry>> BlockEntries(TileKey tile) const;

  /// The blocks of a tile, in order of key, looked up and read together: sooner than BlocksOf and Read of each.
  absl::StatusOr<std::vector<std::shared_ptr<const Block>>> ReadTile(TileKey tile) const;

  /// What StoreDerived kept for this state of the tile; nothing if there is nothing. DATA_LOSS if it is damaged.
  absl::StatusOr<std::optional<std::string>> ReadDerived(const TileEntry& tile) const;
  /// Keeps, for as long as some epoch has this state of the tile, bytes that follow from its content alone: so that
  /// they are made once, by whichever daemon. One such value a tile; it is replaced by the next. Durable with the next
  /// durable write. A write that comes later than its failure was reported may stay behind when the tile is gone.
  absl::Status StoreDerived(const TileEntry& tile, std::string_view bytes) const;

  /// Blocks that were written anew, made or deleted between two epochs of one map, in order; those with equal content
  /// may be among them. INVALID_ARGUMENT if the other one is of another map.
  absl::StatusOr<std::vector<BlockKey>> BlocksChangedSince(const Snapshot& before) const;

 private:
  std::unique_ptr<const State> state_;
};

/// Which map has a name, and how far it is.
struct MapHead {
  uint64_t incarnation = 0;
  uint64_t epoch = 0;
  bool operator==(const MapHead&) const = default;
};

/// What one commit did: the history of a map is the sequence of these.
struct CommitRecord {
  uint64_t epoch = 0;
  std::string session;
  uint64_t base_epoch = 0;  ///< the epoch that the session was aligned to and its exposures counted against
  std::string attempt;      ///< session and 64 random bits
  double time = 0;          ///< seconds since 1970 (UTC)
  std::vector<TileKey> touched_tiles;
  bool rollback = false;         ///< brought the content of base_epoch back, and no session
  uint64_t rollback_before = 0;  ///< of a rollback: the newest one that had made base_epoch; 0: none
};

/// A name for an epoch, which keeps it readable.
struct Tag {
  std::string name;
  uint64_t epoch = 0;
  double time = 0;  ///< when it was given, seconds since 1970 (UTC)
};

/// One epoch of a map's history.
struct MapVersion {
  CommitRecord commit;
  bool readable = false;            ///< not collected
  std::optional<MapTotals> totals;  ///< of a readable one
  uint64_t sessions = 0;            ///< merged up to it; of a readable one
  std::vector<std::string> tags;
};

/// What a check of a whole map found.
struct MapVerification {
  uint64_t epochs = 0, nodes = 0, blocks = 0, voxels = 0;  ///< read and checked; what epochs share counts once
  uint64_t problem_count = 0;
  std::vector<std::string> problems;  ///< the first hundred, in words
};

/// What a rollback did.
struct RollbackOutcome {
  CommitRecord commit;
  std::vector<std::string> withdrawn;  ///< sessions that are no longer in the map
  std::vector<std::string> revived;    ///< sessions that an earlier rollback had taken out, and this one brought back
};

/// A commit to be made. `blocks` computes the changed blocks against the head that it is given (an empty block
/// deletes); it is called again, with the new head, when another commit came first, so it must not keep what it saw.
struct CommitRequest {
  std::string session;
  uint64_t base_epoch = 0;
  uint64_t lease_fence = 0;               ///< of the session's lease, which must not move on; 0: nobody may hold one
  std::optional<Eigen::Vector3d> origin;  ///< sets the map's origin in the same step; only by a map's first commit
  std::function<absl::StatusOr<std::vector<Block>>(const Snapshot& head)> blocks;
};

/// How the store's caches fare.
struct MapCacheUse {
  CacheUse blocks, nodes;
};

/// Versioned maps on an engine: immutable trees of blocks, a head a map, and the commit protocol of the design's
/// section 4. Thread-safe.
class MapStore final {
 public:
  struct State;
  explicit MapStore(std::unique_ptr<State> state);
  ~MapStore();
  MapStore(const MapStore&) = delete;
  MapStore& operator=(const MapStore&) = delete;

  /// ALREADY_EXISTS if the name is taken. Fills in incarnation.
  absl::StatusOr<MapRecord> Create(const MapRecord& record);
  /// NOT_FOUND.
  absl::StatusOr<MapRecord> Find(std::string_view name) const;
  /// By name, after `after` (empty: from the first), at most `limit`.
  absl::StatusOr<std::vector<MapRecord>> List(std::string_view after, size_t limit) const;
  /// Deletes the map and everything in it; snapshots open on it may fail afterwards. NOT_FOUND.
  absl::Status Delete(std::string_view name);

  /// The newest epoch, or a given one: NOT_FOUND if there is no such map or it never had the epoch, FAILED_PRECONDITION
  /// (with the oldest one kept in the message) if that epoch is collected.
  absl::StatusOr<std::unique_ptr<Snapshot>> Open(std::string_view map, std::optional<uint64_t> epoch = {}) const;

  /// Commits exactly once: if the session is applied already, gives the record of then and calls nothing. ABORTED if
  /// the lease moved on, the map was deleted, another session gave the map an origin since the base epoch, or the base
  /// epoch was rolled back; errors of
  /// `blocks` are passed on. On these errors nothing of it is in the map. UNKNOWN or DEADLINE_EXCEEDED if the engine
  /// gives no answer for long: call again to learn the outcome.
  absl::StatusOr<CommitRecord> Commit(std::string_view map, const CommitRequest& request);

  /// A new epoch with the content, origin and sessions of a readable one. Nothing is lost: the epochs in between stay
  /// as readable as they were. Sessions that came in between are no longer applied: they may be committed anew, and
  /// SettleSessions (rolled_back_sessions.h) makes their records say so. A commit under way whose base epoch is no
  /// longer among the ancestors of the head is ABORTED: it starts over on the new head. Errors as of Open.
  absl::StatusOr<RollbackOutcome> Rollback(std::string_view map, uint64_t epoch);

  /// Epochs of the map's history, newest first, from `newest` (nothing: the head) down, at most `limit`. Epoch 0, the
  /// empty map, has a commit without session.
  absl::StatusOr<std::vector<MapVersion>> Versions(std::string_view map, std::optional<uint64_t> newest,
                                                   size_t limit) const;

  /// By name.
  absl::StatusOr<std::vector<Tag>> Tags(std::string_view map) const;
  /// Names a readable epoch (nothing: the head). ALREADY_EXISTS if the name is given to another epoch, errors as of
  /// Open, RESOURCE_EXHAUSTED beyond 1,000 tags.
  absl::StatusOr<Tag> AddTag(std::string_view map, std::string_view name, std::optional<uint64_t> epoch);
  /// NOT_FOUND without the tag.
  absl::Status RemoveTag(std::string_view map, std::string_view name);

  /// Reads everything that the map's readable epochs reach, past the caches, and checks it: checksums, that every value
  /// is there, that the sums in the tree are those of the blocks, `block` (what else is to hold of a block, an error
  /// says what does not), and that nothing is stored in the map's tiles that no epoch reaches and no row names for
  /// collection. May run while the map is served. CANCELLED when `progress` says stop.
  absl::StatusOr<MapVerification> Verify(std::string_view map,
                                         const std::function<absl::Status(const Block&)>& block = {},
                                         const Progress& progress = {}) const;

  /// What the map's newest epoch is, cheaply: two rows, no pin. NOT_FOUND.
  absl::StatusOr<MapHead> Head(std::string_view map) const;

  /// Commits that made epochs (after, newest], oldest first, at most `limit`. NOT_FOUND, also if the map is no longer
  /// the one with that incarnation.
  absl::StatusOr<std::vector<CommitRecord>> CommitsAfter(std::string_view map, const MapHead& after,
                                                         size_t limit) const;

  /// The record of a session's commit, if it is applied.
  absl::StatusOr<std::optional<CommitRecord>> FindCommit(std::string_view map, std::string_view session) const;

  MapCacheUse Caches() const;

 private:
  std::unique_ptr<State> state_;
};

struct MapStoreOptions {
  size_t block_cache_bytes = size_t{256} << 20;  ///< decoded blocks and tree nodes kept in memory
  double intent_seconds = 600;                   ///< after which an unfinished attempt may be collected
  double pin_seconds = 60;                       ///< how long the epochs in use outlive this process if it dies
  Clock now = SystemSeconds;
};

/// `engine` outlives the store.
std::unique_ptr<MapStore> OpenMapStore(Engine& engine, const MapStoreOptions& options);

}  // namespace mapkeep
