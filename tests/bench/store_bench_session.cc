#include "tests/bench/store_bench_session.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include "core/checksum/crc32c.h"
#include "server/pipeline/run_session.h"
#include "storage/block_codec.h"
#include "storage/map_copy.h"
#include "storage/rocksdb_engine.h"
#include "tests/bench/kitti_directory.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;
using SteadyClock = std::chrono::steady_clock;

void Require(const absl::Status& status) {
  if (status.ok()) return;
  std::fprintf(stderr, "%s\n", status.ToString().c_str());
  std::exit(1);
}

template <typename Value>
Value Require(absl::StatusOr<Value> value) {
  Require(value.status());
  return *std::move(value);
}

// Of one daemon.
struct Stores {
  explicit Stores(Engine& engine)
      : maps(OpenMapStore(engine, {})), sessions(OpenSessionStore(engine)), leases(OpenLeases(engine)) {}
  ScanMemory scan_memory{static_cast<size_t>(Limits().scan_cache_mib) << 20};
  std::unique_ptr<MapStore> maps;
  std::unique_ptr<SessionStore> sessions;
  std::unique_ptr<Leases> leases;
  SessionFeed feed;
  PlanCache plans;
};

// Uploads frames [first, last) as a session and queues it, as CommitSession does.
void Upload(Stores& stores, const KittiDirectory& drive, const std::string& id, size_t first, size_t last) {
  SessionRecord record{.map = "m", .id = id, .scan_crc32c = std::vector<uint32_t>(last - first, 1), .created = 1.79e9};
  record = Require(stores.sessions->Begin(record));
  for (size_t frame = first; frame < last; ++frame) {
    const StagedScan scan{Require(KittiDirectory::Read(drive.path, frame)), drive.poses[frame]};
    Require(stores.sessions->AppendScans("m", id, static_cast<uint32_t>(frame - first), {&scan, 1}));
  }
  record = Require(stores.sessions->Find("m", id));
  record.start_time = 1.79e9 + 86400.0 * static_cast<double>(first);
  record.state = SessionState::kQueued;
  Require(stores.sessions->Update(record, SessionState::kUploading));
}

void RunAndPrint(Stores& stores, const std::string& id) {
  const auto began = SteadyClock::now();
  const std::clock_t cpu = std::clock();
  Job job("m", id, false, 0);
  const Lease lease = Require(stores.leases->Acquire("m", id, "bench", 600));
  Require(RunSession(
      {*stores.maps, *stores.sessions, *stores.leases, stores.feed, stores.plans, nullptr, &stores.scan_memory}, {},
      job, lease.fence));
  Require(stores.leases->Release(lease));
  const double seconds = std::chrono::duration<double>(SteadyClock::now() - began).count();
  const double cpu_seconds = static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC;  // of all threads
  const SessionRecord done = Require(stores.sessions->Find("m", id));
  if (done.state != SessionState::kCommitted) {
    std::fprintf(stderr, "session %s was not committed: %s\n", id.c_str(), done.reason.c_str());
    std::exit(1);
  }
  const auto scans = static_cast<double>(done.scan_crc32c.size());
  std::string line =
      absl::StrFormat("%s: %d scans, acknowledged to committed epoch %d: %.1f ms a scan (CPU %.1f)", id,
                      done.scan_crc32c.size(), done.report.epoch, 1e3 * seconds / scans, 1e3 * cpu_seconds / scans);
  double rest = seconds;
  for (const StageTime& stage : done.report.stages) {
    rest -= stage.seconds;
    absl::StrAppendFormat(&line, "; %s %.1f (%.0f %%)", stage.stage, 1e3 * stage.seconds / scans,
                          100 * stage.seconds / seconds);
  }
  std::printf("%s; the rest %.1f (%.0f %%)\n", line.c_str(), 1e3 * rest / scans, 100 * rest / seconds);
}

std::vector<Block> BlocksOf(const Snapshot& snapshot) {
  std::vector<Block> blocks;
  for (const TileKey tile : Require(snapshot.Tiles(std::nullopt))) {
    for (const BlockKey key : Require(snapshot.BlocksOf(tile))) blocks.push_back(*Require(snapshot.Read(key)));
  }
  return blocks;
}

// One field of a voxel, to be encoded alone.
struct Column {
  const char* name;
  void (*copy)(const Voxel& from, Voxel& to);
};

constexpr Column kColumns[] = {
    {"position", [](const Voxel& from, Voxel& to) { to.position = from.position; }},
    {"hits", [](const Voxel& from, Voxel& to) { to.hits = from.hits; }},
    {"exposures", [](const Voxel& from, Voxel& to) { to.exposures = from.exposures; }},
    {"flags",
     [](const Voxel& from, Voxel& to) {
       to.ground = from.ground;
       to.is_static = from.is_static;
     }},
    {"mean", [](const Voxel& from, Voxel& to) { to.mean = from.mean; }},
    {"normal", [](const Voxel& from, Voxel& to) { to.normal = from.normal; }},
    {"intensity", [](const Voxel& from, Voxel& to) { to.intensity = from.intensity; }},
    {"mask", [](const Voxel& from, Voxel& to) { to.mask = from.mask; }},
    {"times",
     [](const Voxel& from, Voxel& to) {
       to.first_seen = from.first_seen;
       to.last_seen = from.last_seen;
     }},
};

size_t EncodedBytes(const std::vector<Block>& blocks) {
  return std::accumulate(blocks.begin(), blocks.end(), size_t{0},
                         [](size_t sum, const Block& block) { return sum + Require(EncodeBlock(block)).size(); });
}

// Of all that the map says: the same for the same sessions, on any number of threads.
uint32_t ChecksumOf(const std::vector<Block>& blocks) {
  uint32_t checksum = 0;
  for (const Block& block : blocks) checksum = Crc32c(Require(EncodeBlock(block)), checksum);
  return checksum;
}

// Bytes that a column adds to blocks whose other columns say nothing.
double BytesOfColumn(const std::vector<Block>& blocks, const Column& column) {
  std::vector<Block> empty, filled;
  for (const Block& block : blocks) {
    Block bare{block.key, std::vector<Voxel>(block.voxels.size())};
    for (size_t i = 0; i < bare.voxels.size(); ++i) bare.voxels[i].position = static_cast<uint16_t>(i);
    empty.push_back(bare);
    for (size_t i = 0; i < bare.voxels.size(); ++i) column.copy(block.voxels[i], bare.voxels[i]);
    filled.push_back(std::move(bare));
  }
  return static_cast<double>(EncodedBytes(filled)) - static_cast<double>(EncodedBytes(empty));
}

// Of the head in a store of its own, once everything lies in files.
uint64_t BytesOnDisk(Engine& engine, uint64_t epoch, const std::string& directory) {
  for (int open = 0; open < 2; ++open) {  // the second opening writes the log into files
    const auto alone = Require(OpenRocksDbEngine(directory));
    if (open == 0) Require(CopyMap(engine, *alone, "m", "m", epoch));
    Require(alone->Sync());
  }
  uint64_t bytes = 0;
  for (const auto& file : fs::directory_iterator(directory)) {
    const std::string kind = file.path().extension();
    if (kind == ".blob" || kind == ".sst") bytes += file.file_size();
  }
  fs::remove_all(directory);
  return bytes;
}

void PrintBytes(Engine& engine, const MapStore& maps, const std::string& directory) {
  const auto head = Require(maps.Open("m"));
  const std::vector<Block> blocks = BlocksOf(*head);
  const auto voxels = static_cast<double>(head->totals().voxels);
  std::string line = absl::StrFormat(
      "%d voxels in %d blocks (crc32c %08x): %.2f bytes a voxel on disk, %.2f of them blocks; columns alone:",
      head->totals().voxels, head->totals().blocks, ChecksumOf(blocks),
      static_cast<double>(BytesOnDisk(engine, head->epoch(), directory)) / voxels,
      static_cast<double>(EncodedBytes(blocks)) / voxels);
  for (const Column& column : kColumns) {
    absl::StrAppendFormat(&line, " %s %.2f", column.name, BytesOfColumn(blocks, column) / voxels);
  }
  std::printf("%s\n", line.c_str());
}

}  // namespace

void RunWholeSessions(const std::string& directory, const std::string& drive_directory) {
  const KittiDirectory drive(drive_directory);
  const auto engine = Require(OpenRocksDbEngine(directory + "/db"));
  Stores stores(*engine);
  Require(stores.maps->Create({.name = "m", .voxel_size = 0.2}).status());
  const size_t half = drive.poses.size() / 2;
  Upload(stores, drive, "first", 0, half);
  RunAndPrint(stores, "first");
  Upload(stores, drive, "second", half, drive.poses.size());
  RunAndPrint(stores, "second");
  PrintBytes(*engine, *stores.maps, directory + "/alone");
}

}  // namespace mapkeep
