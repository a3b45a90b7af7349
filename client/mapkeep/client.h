#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "client/mapkeep/localize.h"
#include "client/mapkeep/map_info.h"
#include "client/mapkeep/map_tiles.h"
#include "client/mapkeep/session_info.h"
#include "core/geometry/pose.h"
#include "core/geometry/progress.h"
#include "core/geometry/scan.h"
#include "core/scan_payload/scan_payload.h"
#include "core/voxels/block.h"

namespace mapkeep {

struct ClientOptions {
  std::string server = "127.0.0.1:7443";  ///< HOST:PORT
  double connect_seconds = 3;             ///< how long a call waits for a server that does not answer
  double patience_seconds = 180;  ///< how long an upload or a watch, once begun, outlasts a break without progress

  bool tls = false;               ///< TLS with the system's authorities; implied by the files below
  std::string tls_ca;             ///< PEM file: authorities that may have signed the server's certificate
  std::string tls_cert, tls_key;  ///< PEM files: this client's own certificate, where the server asks for one
  std::string token;              ///< sent with every call; empty: none
  bool insecure = false;          ///< send the token also without TLS to another machine
};

/// A session to upload. `scans` and the spans outlive the call.
struct SessionUpload {
  std::string map, id;
  std::string robot;        ///< who drove; may be empty
  bool keep_scans = false;  ///< on the server, after the commit
  ScanSource scans;
  std::span<const Pose> poses;          ///< T_odometry_sensor of each scan
  std::span<const uint32_t> checksums;  ///< of each scan in that encoding, by ScanChecksums
  ScanEncoding encoding = ScanEncoding::kRaw;
  std::optional<KnownStart> start;  ///< where the first scan was taken, if it is roughly known
  std::optional<GnssStart> gnss;    ///< the same by GNSS; only on a map with a CRS
};

/// How far an upload is.
struct UploadProgress {
  uint32_t durable_scans = 0, scan_count = 0;
  uint64_t durable_bytes = 0;  ///< of the durable scans, as they were sent
  bool is_broken = false;      ///< the connection is lost, and another try is to come
};

/// Which blocks to stream.
struct BlockQuery {
  std::string map;
  std::optional<uint64_t> epoch;           ///< nothing: the newest
  std::optional<Eigen::AlignedBox3d> box;  ///< metres relative to the origin; nothing: everything
  bool include_all = false;                ///< also what the map filter does not hold to be static
};

class Connection;

/// A connection to a mapkeepd. Calls block; several threads may share one client. Errors carry the server's code and
/// message; UNAVAILABLE: it cannot be reached. gRPC stays out of this header.
class Client {
 public:
  explicit Client(const ClientOptions& options = {});
  ~Client();
  Client(Client&&) noexcept;
  Client& operator=(Client&&) noexcept;

  const ClientOptions& options() const;

  absl::StatusOr<MapInfo> CreateMap(const NewMap& map) const;
  absl::StatusOr<MapInfo> GetMap(std::string_view name) const;
  absl::StatusOr<std::vector<MapInfo>> ListMaps() const;
  absl::Status DeleteMap(std::string_view name) const;
  /// Makes a map of all the blocks that `next` gives, in order of their keys, until it gives none. The map is there
  /// when this has succeeded. ALREADY_EXISTS if the name is taken; errors of `next` are passed on.
  absl::StatusOr<MapInfo> ImportMap(const NewMap& map,
                                    const std::function<absl::StatusOr<std::vector<Block>>()>& next) const;
  /// The voxel that holds `point`, metres relative to the origin. NOT_FOUND if it was never hit.
  absl::StatusOr<VoxelInfo> QueryVoxel(std::string_view map, const Eigen::Vector3d& point) const;

  /// Newest first, at most `limit`.
  absl::StatusOr<std::vector<VersionInfo>> ListVersions(std::string_view map, size_t limit) const;
  /// Names an epoch (nothing: the newest), which then stays readable; gives that epoch.
  absl::StatusOr<uint64_t> AddTag(std::string_view map, std::string_view tag, std::optional<uint64_t> epoch) const;
  absl::Status RemoveTag(std::string_view map, std::string_view tag) const;
  absl::StatusOr<RollbackInfo> RollBackMap(std::string_view map, uint64_t epoch) const;
  /// Streams the blocks that differ between two epochs (`after` nothing: the newest): `begin` once, with the later one,
  /// then `change` for each; gives the objects that the changes make up. Stops with the error that a callback returns.
  absl::StatusOr<ChangedObjectsInfo> CompareEpochs(
      std::string_view map, uint64_t before, std::optional<uint64_t> after,
      const std::function<absl::Status(const MapSnapshot&)>& begin,
      const std::function<absl::Status(const BlockChangeInfo&)>& change) const;

  // Upkeep of the daemon's store; directories are on its machine. These may take hours.
  absl::StatusOr<VerificationInfo> VerifyMap(std::string_view map) const;
  absl::StatusOr<GarbageInfo> CollectGarbage(bool dry_run) const;
  /// RADOS: one map, as of an epoch (nothing: the newest). RocksDB: everything, without map and epoch. Gives the maps.
  absl::StatusOr<std::vector<std::string>> Backup(const std::string& directory, std::string_view map,
                                                  std::optional<uint64_t> epoch) const;
  /// One map (under another name, if `as` is not empty) or every one. Gives the maps by their new names.
  absl::StatusOr<std::vector<std::string>> Restore(const std::string& directory, std::string_view map,
                                                   std::string_view as) const;
  absl::StatusOr<ReplayInfo> ReplayMap(std::string_view map) const;

  /// Uploads what the server does not have yet and queues the session; gives the session as it is then, which may
  /// already have ended if the same content came before. After a break it asks what is durable and goes on, with longer
  /// and longer pauses while the server is away. CANCELLED when `progress`, which may be called from another thread,
  /// says stop.
  absl::StatusOr<SessionInfo> UploadSession(const SessionUpload& upload,
                                            const std::function<bool(const UploadProgress&)>& progress = {}) const;
  absl::StatusOr<SessionInfo> GetSession(std::string_view map, std::string_view id) const;
  /// Ordered by time of creation.
  absl::StatusOr<std::vector<SessionInfo>> ListSessions(std::string_view map) const;
  /// Calls `changed` with the session now and after each change until it has ended, or `changed` returns false; gives
  /// the session as it was last.
  absl::StatusOr<SessionInfo> WatchSession(std::string_view map, std::string_view id,
                                           const std::function<bool(const SessionInfo&)>& changed) const;
  /// Queues a refused or failed session once more, from where its first scan was taken if that is given.
  absl::StatusOr<SessionInfo> RetrySession(std::string_view map, std::string_view id,
                                           const std::optional<KnownStart>& start) const;
  /// Where a few scans were taken in a map. That it cannot be told is an answer, not an error.
  absl::StatusOr<LocalizeAnswer> Localize(const LocalizeQuestion& question) const;
  absl::Status DeleteSession(std::string_view map, std::string_view id) const;
  /// Aligned poses of a committed session, T_map_sensor, one a scan.
  absl::StatusOr<std::vector<Pose>> ListScanPoses(std::string_view map, std::string_view id) const;

  /// Streams voxel blocks, all of one epoch, in order of tile: `begin` once, then `block` for each. Stops with the
  /// error that a callback returns.
  absl::Status StreamBlocks(const BlockQuery& query, const std::function<absl::Status(const MapSnapshot&)>& begin,
                            const std::function<absl::Status(const Block&)>& block) const;

  /// Versions and sizes of tiles with static voxels, all of one epoch.
  absl::StatusOr<TileList> ListTiles(const TileQuery& query) const;
  /// Streams the tiles with these ids that the map has (no ids: those of the area); gives their epoch. Stops with the
  /// error that `tile` returns.
  absl::StatusOr<uint64_t> GetTiles(const TileQuery& query, const std::vector<TileId>& ids,
                                    const std::function<absl::Status(const EncodedTile&)>& tile) const;
  /// What brings the holder of some tiles to those of the query, all of one epoch: `begin` once, then `tile` for each
  /// that is new or changed. Stops with the error that a callback returns.
  absl::Status SyncTiles(const TileQuery& query, const std::vector<HeldTile>& held,
                         const std::function<absl::Status(const TileChangesInfo&)>& begin,
                         const std::function<absl::Status(const EncodedTile&)>& tile) const;
  /// Calls `event` with the newest epoch (after a token: with every one since), then with each new one, until it
  /// returns false; gives the token to go on from. Outlasts breaks as long as patience_seconds allow.
  absl::StatusOr<std::string> WatchMap(std::string_view map, std::string resume_token,
                                       const std::function<bool(const MapEvent&)>& event) const;

 private:
  std::unique_ptr<Connection> connection_;
};

}  // namespace mapkeep
