#include "client/mapkeep/tile_folder.h"

#include <absl/status/status.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <system_error>
#include <utility>

#include "client/mapkeep/patience.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

constexpr int kFormat = 1;
constexpr char kManifest[] = "manifest.json", kTiles[] = "tiles", kLock[] = "lock", kPartial[] = ".partial";

absl::Status Unwritable(const fs::path& path, int error) {
  return absl::UnknownError(absl::StrCat(path.string(), ": cannot be written: ", std::strerror(error)));
}

std::string_view NameOf(TileDetail detail) { return detail == TileDetail::kSubVoxels ? "sub-voxels" : "centroids"; }

/// Versions are the server's; they become parts of file names.
bool IsFit(std::string_view version) {
  return !version.empty() && version.size() <= 64 &&
         std::ranges::all_of(version, [](unsigned char c) { return std::isalnum(c) != 0 || c == '-' || c == '_'; });
}

std::string FileNameOf(const TileId& id, std::string_view version) {
  return absl::StrFormat("%d_%d.%s.tile", id.x, id.y, version);
}

/// The file's bytes appear under its name as a whole or not at all.
absl::Status WriteWhole(const fs::path& path, std::string_view bytes, bool durable) {
  fs::path temporary = path;
  temporary += kPartial;
  const int file = open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (file < 0) return Unwritable(path, errno);
  while (!bytes.empty()) {
    const ssize_t written = write(file, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) {
      const int error = errno;
      close(file);
      return Unwritable(path, error);
    }
    bytes.remove_prefix(static_cast<size_t>(written));
  }
  const bool synced = !durable || fsync(file) == 0;
  const int error = errno;
  if (close(file) != 0) return Unwritable(path, errno);
  if (!synced) return Unwritable(path, error);
  if (rename(temporary.c_str(), path.c_str()) != 0) return Unwritable(path, errno);
  return absl::OkStatus();
}

/// Makes everything that was written below a directory survive a crash of the machine.
absl::Status Settle(const fs::path& directory) {
  const int handle = open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (handle < 0) return Unwritable(directory, errno);
  const bool settled = syncfs(handle) == 0;
  const int error = errno;
  close(handle);
  return settled ? absl::OkStatus() : Unwritable(directory, error);
}

std::string ReadAll(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream bytes;
  bytes << in.rdbuf();
  return std::move(bytes).str();
}

nlohmann::json JsonOf(const TileManifest& manifest) {
  nlohmann::json tiles = nlohmann::json::array();
  for (const TileFile& tile : manifest.tiles) {
    tiles.push_back({{"x", tile.id.x},
                     {"y", tile.id.y},
                     {"version", tile.version},
                     {"file", absl::StrCat(kTiles, "/", tile.path.filename().string())},
                     {"bytes", tile.bytes}});
  }
  return {{"mapkeepTiles", kFormat},
          {"map", manifest.map},
          {"detail", NameOf(manifest.detail)},
          {"epoch", manifest.epoch},
          {"tiles", std::move(tiles)}};
}

/// The folder while this process keeps it.
class TileFolder {
 public:
  static absl::StatusOr<TileFolder> Open(const fs::path& path, const TileQuery& query) {
    std::error_code error;
    fs::create_directories(path / kTiles, error);
    if (error) return absl::UnknownError(absl::StrCat(path.string(), ": cannot be made: ", error.message()));
    TileFolder folder(path, query);
    folder.lock_ = open((path / kLock).c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
    if (folder.lock_ < 0) return Unwritable(path / kLock, errno);
    if (flock(folder.lock_, LOCK_EX | LOCK_NB) != 0) {
      return absl::AbortedError(absl::StrCat(path.string(), ": another process keeps this folder"));
    }
    absl::StatusOr<TileManifest> manifest = ReadTileManifest(path);
    if (manifest.ok() && manifest->map != query.map) {
      return absl::FailedPreconditionError(
          absl::StrFormat("%s: holds tiles of map %s, not of %s", path.string(), manifest->map, query.map));
    }
    if (manifest.ok()) {
      folder.Take(*manifest);
    } else if (!absl::IsNotFound(manifest.status())) {
      return manifest.status();
    }
    folder.TakeStrays();
    return folder;
  }
  TileFolder(TileFolder&& other) noexcept
      : path_(std::move(other.path_)),
        query_(other.query_),
        lock_(std::exchange(other.lock_, -1)),
        tiles_(std::move(other.tiles_)) {}
  ~TileFolder() {
    if (lock_ >= 0) close(lock_);
  }

  std::vector<HeldTile> Held() const {
    std::vector<HeldTile> held;
    for (const auto& [id, tile] : tiles_) held.push_back({id, tile.version});
    return held;
  }

  absl::Status Add(const EncodedTile& tile) {
    if (!IsFit(tile.version)) {
      return absl::DataLossError(
          absl::StrFormat("tile (%d, %d) from the server: its version is no version", tile.id.x, tile.id.y));
    }
    const fs::path path = path_ / kTiles / FileNameOf(tile.id, tile.version);
    if (absl::Status status = WriteWhole(path, tile.bytes, false); !status.ok()) return status;
    tiles_[tile.id] = {tile.id, tile.version, path, tile.bytes.size()};
    return absl::OkStatus();
  }

  void Drop(const TileId& id) { tiles_.erase(id); }

  /// Everything is there: the manifest says so from now on, and what it does not name goes.
  absl::StatusOr<TileSyncResult> Finish(uint64_t epoch) {
    TileManifest manifest{.map = query_.map, .detail = query_.detail, .epoch = epoch, .tiles = {}};
    TileSyncResult result{.epoch = epoch};
    for (const auto& [id, tile] : tiles_) {
      manifest.tiles.push_back(tile);
      result.bytes += tile.bytes;
    }
    result.tiles = manifest.tiles.size();
    if (absl::Status status = Settle(path_ / kTiles); !status.ok()) return status;
    const std::string text = JsonOf(manifest).dump(1) + "\n";
    if (absl::Status status = WriteWhole(path_ / kManifest, text, true); !status.ok()) return status;
    if (absl::Status status = Settle(path_); !status.ok()) return status;
    RemoveUnnamed();
    return result;
  }

 private:
  TileFolder(fs::path path, const TileQuery& query) : path_(std::move(path)), query_(query) {}

  /// The manifest's tiles that are there, if they are what is asked for now.
  void Take(const TileManifest& manifest) {
    if (manifest.detail != query_.detail) return;
    for (const TileFile& tile : manifest.tiles) {
      std::error_code error;
      if (fs::file_size(tile.path, error) == tile.bytes && !error) tiles_[tile.id] = tile;
    }
  }

  /// Tiles that an earlier run received and did not live to name. A crash of the machine may have left them damaged.
  /// Those older than the manifest are what it replaced and did not live to remove: taken for held, they would hide
  /// tiles that it names.
  void TakeStrays() {
    const std::set<std::string> named = Named();  // before strays take the places of the manifest's tiles
    std::error_code error, none;
    const fs::file_time_type settled = fs::last_write_time(path_ / kManifest, none);
    for (const fs::directory_entry& entry : fs::directory_iterator(path_ / kTiles, error)) {
      const fs::path& path = entry.path();
      if (path.extension() != ".tile" || named.contains(path.filename().string())) continue;
      if (!none && entry.last_write_time(error) < settled) continue;
      const std::string bytes = ReadAll(path);
      const absl::StatusOr<MapTile> tile = DecodeTile(bytes);
      const bool is_ours = tile.ok() && tile->map == query_.map &&
                           tile->has_masks == (query_.detail == TileDetail::kSubVoxels) &&
                           path.filename() == FileNameOf(tile->id, tile->version);
      if (is_ours) tiles_[tile->id] = {tile->id, tile->version, path, bytes.size()};
    }
  }

  /// Names of the files that are held.
  std::set<std::string> Named() const {
    std::set<std::string> named;
    for (const auto& [id, tile] : tiles_) named.insert(tile.path.filename().string());
    return named;
  }

  void RemoveUnnamed() const {
    const std::set<std::string> named = Named();
    std::error_code error;
    for (const fs::directory_entry& entry : fs::directory_iterator(path_ / kTiles, error)) {
      if (!named.contains(entry.path().filename().string())) fs::remove(entry.path(), error);
    }
  }

  fs::path path_;
  TileQuery query_;
  int lock_ = -1;
  std::map<TileId, TileFile> tiles_;
};

}  // namespace

absl::StatusOr<TileManifest> ReadTileManifest(const fs::path& folder) {
  const fs::path path = folder / kManifest;
  std::error_code error;
  if (!fs::exists(path, error)) return absl::NotFoundError(absl::StrCat(path.string(), ": there is none"));
  const absl::Status alien = absl::FailedPreconditionError(
      absl::StrCat(path.string(), ": is not the manifest of a folder of tiles; take another folder, or remove it"));
  const nlohmann::json json = nlohmann::json::parse(ReadAll(path), nullptr, false);
  if (!json.is_object() || json.value("mapkeepTiles", nlohmann::json()) != kFormat) return alien;
  try {
    TileManifest manifest;
    manifest.map = json.at("map").get<std::string>();
    manifest.detail = json.at("detail").get<std::string>() == NameOf(TileDetail::kSubVoxels) ? TileDetail::kSubVoxels
                                                                                             : TileDetail::kCentroids;
    manifest.epoch = json.at("epoch").get<uint64_t>();
    for (const nlohmann::json& entry : json.at("tiles")) {
      TileFile tile{.id = {entry.at("x").get<int32_t>(), entry.at("y").get<int32_t>()},
                    .version = entry.at("version").get<std::string>(),
                    .path = {},
                    .bytes = entry.at("bytes").get<uint64_t>()};
      if (!IsFit(tile.version)) return alien;
      tile.path = folder / kTiles / FileNameOf(tile.id, tile.version);
      manifest.tiles.push_back(std::move(tile));
    }
    return manifest;
  } catch (const nlohmann::json::exception&) {
    return alien;
  }
}

absl::StatusOr<TileSyncResult> SyncTileFolder(const Client& client, const TileQuery& query, const fs::path& folder,
                                              const std::function<void(const TileSyncProgress&)>& progress) {
  absl::StatusOr<TileFolder> held = TileFolder::Open(folder, query);
  if (!held.ok()) return held.status();
  Patience patience(client.options().patience_seconds);
  TileSyncResult total;
  for (bool reached = false;;) {
    TileSyncProgress at;
    uint64_t epoch = 0, dropped = 0;
    const absl::Status status = client.SyncTiles(
        query, held->Held(),
        [&](const TileChangesInfo& changes) {
          reached = true;
          epoch = changes.epoch;
          for (const TileId& id : changes.dropped) held->Drop(id);
          dropped = changes.dropped.size();
          at.of_tiles = changes.changed_tiles;
          at.of_bytes = changes.changed_bytes;
          if (progress) progress(at);
          return absl::OkStatus();
        },
        [&](const EncodedTile& tile) {
          patience.Renew();
          ++at.tiles;
          at.bytes += tile.bytes.size();
          if (absl::Status added = held->Add(tile); !added.ok()) return added;
          if (progress) progress(at);
          return absl::OkStatus();
        });
    total.dropped += dropped;
    total.received += at.tiles;
    total.received_bytes += at.bytes;
    if (status.ok()) {
      absl::StatusOr<TileSyncResult> result = held->Finish(epoch);
      if (!result.ok()) return result;
      result->received = total.received;
      result->received_bytes = total.received_bytes;
      result->dropped = total.dropped;
      return result;
    }
    // A reader so slow that its epoch was collected goes on at the newest one.
    const bool passing = absl::IsUnavailable(status) || (absl::IsFailedPrecondition(status) && at.tiles > 0);
    if (!reached || !passing || !patience.Wait()) return status;
  }
}

}  // namespace mapkeep
