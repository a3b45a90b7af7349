// store_bench DIR [--rados CEPH_CONF POOL | --most COPIES | --memory | --drive KITTI_DIR]
// The map store under a session of fixed size whatever the map around it: seconds of merge, filter and durable commit
// into maps of 1x, 10x, 50x and 200x the session's area (RADOS: to 50x), each in a store of its own, in turns, so that
// what else the machine does falls on all of them alike; tiles read at an old epoch and at the head, the head after
// 1,000 epochs, opening the store, bytes a voxel. The blocks are made up: ground of random detail, which compresses
// worse than a real street. DIR is made and removed. Ratios are of one run. --memory
// writes and reads maps of two sizes with small caches and fails if the larger one takes more memory. With --drive,
// real sessions go through the whole pipeline instead: see store_bench_session.h.

#include <absl/strings/str_format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>

#include "server/pipeline/stages.h"
#include "storage/block_codec.h"
#include "storage/rados_engine.h"
#include "storage/rocksdb_engine.h"
#include "tests/bench/store_bench_session.h"

namespace mapkeep {
namespace {

constexpr int kBlocksAlong = 24;  // of the session's square of blocks: 154 m, as many voxels as a drive of KITTI
constexpr int kRuns = 15;
constexpr int kReadRuns = 41;
constexpr double kVoxelSize = 0.2;
constexpr size_t kSmallCache = size_t{8} << 20;  // bytes, of --memory
constexpr double kMemorySlack = 64;              // MiB; the maps differ by several hundred

using Clock = std::chrono::steady_clock;

double SecondsSince(Clock::time_point began) { return std::chrono::duration<double>(Clock::now() - began).count(); }

template <typename Value>
Value Require(absl::StatusOr<Value> value) {
  if (value.ok()) return *std::move(value);
  std::fprintf(stderr, "%s\n", value.status().ToString().c_str());
  std::exit(1);
}

double Median(std::vector<double> values) {
  std::ranges::nth_element(values, values.begin() + values.size() / 2);
  return values[values.size() / 2];
}

// Ground: half the columns of a block, each with one voxel.
Block GroundBlock(const VoxelIndex& at, std::mt19937_64& random) {
  Block block{.key = BlockKeyOf(at)};
  for (uint16_t cell = 0; cell < 1024; ++cell) {
    if (random() % 2 == 0) continue;
    const uint16_t position = cell + 1024 * static_cast<uint16_t>(4 + random() % 2);
    Voxel voxel{.position = position, .hits = 80, .exposures = static_cast<uint16_t>(random() % 16), .ground = true};
    voxel.is_static = true;
    for (uint8_t& mean : voxel.mean) mean = random();
    voxel.normal = {static_cast<uint8_t>(126 + random() % 4), static_cast<uint8_t>(126 + random() % 4)};
    voxel.intensity = 40 + random() % 16;
    voxel.mask = uint64_t{random() & 0xffff} << 16 | 1;
    voxel.first_seen = voxel.last_seen = 1000;
    block.voxels.push_back(voxel);
  }
  std::ranges::sort(block.voxels, {}, &Voxel::position);
  return block;
}

// One square of ground, `copy` squares to the east.
std::vector<Block> Area(int copy) {
  std::mt19937_64 random(copy + 1);
  std::vector<Block> blocks;
  for (int x = 0; x < kBlocksAlong; ++x) {
    for (int y = 0; y < kBlocksAlong; ++y) blocks.push_back(GroundBlock({copy * kBlocksAlong + x, y, 0}, random));
  }
  return blocks;
}

// A session that sees the first square again.
SessionMap SessionOver(const std::vector<Block>& blocks, uint32_t minutes) {
  SessionMap session{.voxel_size = kVoxelSize, .start_minutes = minutes, .n_max = 30};
  for (const Block& block : blocks) {
    for (const Voxel& voxel : block.voxels) {
      session.voxels.push_back({.key = VoxelKeyOf(block.key, voxel.position),
                                .hits = 10,
                                .ground = true,
                                .mean = voxel.mean,
                                .normal = voxel.normal,
                                .intensity = voxel.intensity,
                                .mask = voxel.mask});
    }
  }
  std::ranges::sort(session.voxels, {}, &SessionVoxel::key);
  return session;
}

void PrintBytes() {
  size_t bytes = 0, voxels = 0;
  for (const Block& block : Area(0)) {
    bytes += Require(EncodeBlock(block)).size();
    voxels += block.voxels.size();
  }
  std::printf("made-up blocks: %.1f bytes a voxel\n", static_cast<double>(bytes) / static_cast<double>(voxels));
}

// Resident memory of this process, MiB.
double ResidentMib() {
  std::ifstream file("/proc/self/statm");
  double pages = 0;
  file >> pages >> pages;
  return pages * static_cast<double>(::sysconf(_SC_PAGESIZE)) / (1 << 20);
}

// A store with one map of so many squares.
class Bench {
 public:
  // Of all threads together; the CPU time does not depend on what else the machine does.
  struct Spent {
    double seconds = 0, cpu_seconds = 0, merge_seconds = 0;
  };

  Bench(std::function<std::unique_ptr<Engine>()> open, int most_copies, const MapStoreOptions& options = {})
      : open_(std::move(open)), most_copies_(most_copies), options_(options) {
    Open();
    Require(maps_->Create({.name = "m", .voxel_size = kVoxelSize}));
  }

  void Grow() { GrowTo(most_copies_); }

  int copies() const { return copies_; }
  uint64_t voxels() const { return Require(maps_->Open("m"))->totals().voxels; }
  size_t session_voxels() const { return session_.voxels.size(); }

  Spent CommitSession() {
    session_ = SessionOver(Area(0), 1000 + commits_);
    const auto base = Require(maps_->Open("m"));
    const ScanSource none{0, {}};
    const MergeInput input{*base, session_, none, {}, {}, {}};
    double merge_seconds = 0;
    const auto began = Clock::now();
    const std::clock_t cpu = std::clock();
    Commit([&](const Snapshot& head) -> absl::StatusOr<std::vector<Block>> {
      const auto merging = Clock::now();
      auto merged = MergeIntoMap(head, input, {}, {}, {});
      merge_seconds = SecondsSince(merging);
      if (!merged.ok()) return merged.status();
      return std::move(merged->changed);
    });
    return {SecondsSince(began), static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC, merge_seconds};
  }

  // Reads, and opening.
  void MeasureReads() {
    OldEpochs();
    if (most_copies_ >= 10) ManyEpochs();
    std::vector<double> opened;
    for (int run = 0; run < 5; ++run) opened.push_back(Reopen());
    std::printf("opening the store with %d squares and %d epochs: %.1f ms\n", copies_, commits_, 1e3 * Median(opened));
  }

  // Whether a map takes no more memory, written and read whole, than one of a quarter of its size.
  bool RunMemory() {
    double smaller = 0;
    for (const int copies : {most_copies_ / 4, most_copies_}) {
      double most = 0;
      for (int made = copies_; made < copies; ++made) {
        GrowTo(made + 1);
        most = std::max(most, ResidentMib());
      }
      const auto head = Require(maps_->Open("m"));
      for (const TileKey tile : Require(head->Tiles(std::nullopt))) {
        for (const BlockKey key : Require(head->BlocksOf(tile))) Require(head->Read(key));
        most = std::max(most, ResidentMib());
      }
      const double decoded = static_cast<double>(head->totals().voxels * sizeof(Voxel)) / (1 << 20);
      std::printf("%4dx: at most %.0f MiB resident, for a map of %.0f MiB in memory\n", copies, most, decoded);
      if (copies == most_copies_) return most < smaller + kMemorySlack;
      smaller = most;
    }
    return false;
  }

 private:
  void Open() {
    engine_ = open_();
    maps_ = OpenMapStore(*engine_, options_);
  }

  double Reopen() {
    maps_.reset();
    engine_.reset();
    const auto began = Clock::now();
    Open();
    Require(maps_->Open("m"));
    return SecondsSince(began);
  }

  void Commit(const std::function<absl::StatusOr<std::vector<Block>>(const Snapshot&)>& blocks) {
    Require(maps_->Commit("m", {.session = absl::StrFormat("s%d", commits_++), .base_epoch = 0, .blocks = blocks}));
  }

  void GrowTo(int copies) {
    for (; copies_ < copies; ++copies_) Commit([this](const Snapshot&) { return Area(copies_); });
  }

  // Seconds a tile to read every tile of the first square in a random order, with nothing in the caches of the store.
  double ReadTiles(Engine& engine, std::optional<uint64_t> epoch) {
    const auto cold = OpenMapStore(engine, {.block_cache_bytes = 0});
    const auto snapshot = Require(cold->Open("m", epoch));
    std::vector<TileKey> tiles =
        Require(snapshot->Tiles(BlockRange{{0, 0, 0}, {kBlocksAlong - 1, kBlocksAlong - 1, 0}}));
    std::ranges::shuffle(tiles, std::mt19937_64(1));
    const auto began = Clock::now();
    for (const TileKey tile : tiles) {
      Require(snapshot->ReadTile(tile));
    }
    return SecondsSince(began) / static_cast<double>(tiles.size());
  }

  // Seconds a tile of each, read in turns, so that what else the machine does falls on both.
  struct Compared {
    double first = 0, second = 0;
  };
  Compared ReadInTurns(const std::function<double()>& first, const std::function<double()>& second) {
    std::vector<double> firsts, seconds;
    for (int run = 0; run < kReadRuns; ++run) {
      // Whoever goes second finds warmer caches.
      if (run % 2 == 0) firsts.push_back(first());
      seconds.push_back(second());
      if (run % 2 == 1) firsts.push_back(first());
    }
    return {Median(firsts), Median(seconds)};
  }

  // The head just committed lies in RocksDB's memory for writes, where it is read sooner than from files, at whatever
  // epoch: once like this, with the old epoch in files; once when all is in files, as the store is after it was opened.
  void OldEpochs() {
    for (const bool settled : {false, true}) {
      Reopen();
      if (!settled) CommitSession();
      const auto [old, head] =
          ReadInTurns([this] { return ReadTiles(*engine_, 2); }, [this] { return ReadTiles(*engine_, std::nullopt); });
      std::printf("tile at epoch 2: %.3f ms, at the head: %.3f ms, ratio %.2f (%s)\n", 1e3 * old, 1e3 * head,
                  old / head, settled ? "all in files" : "the head just committed");
    }
  }

  // Compares with a copy of the store from before the epochs, where an engine makes copies; with its own past
  // otherwise.
  void ManyEpochs() {
    Reopen();
    const std::string copied =
        (std::filesystem::temp_directory_path() / absl::StrFormat("store_bench.%d", getpid())).string();
    const bool has_copy = engine_->Checkpoint(copied).ok();
    const double past = ReadTiles(*engine_, std::nullopt);
    const auto began = Clock::now();
    constexpr int kEpochs = 1000;
    const Block small{BlockKeyOf(VoxelIndex{0, 0, 50}), {}};
    for (int i = 0; i < kEpochs; ++i) {
      Commit([&](const Snapshot&) -> absl::StatusOr<std::vector<Block>> {
        Block block = small;
        block.voxels = {{.position = static_cast<uint16_t>(i), .hits = 8, .mask = 1}};
        return std::vector{block};
      });
    }
    const double each = SecondsSince(began) / kEpochs;
    const std::unique_ptr<Engine> before = has_copy ? Require(OpenRocksDbEngine(copied)) : nullptr;
    const auto [first, second] =
        ReadInTurns([&] { return before == nullptr ? past : ReadTiles(*before, std::nullopt); },
                    [this] { return ReadTiles(*engine_, std::nullopt); });
    std::printf(
        "tile at the head before and after 1,000 epochs: %.3f and %.3f ms, ratio %.2f; a small commit: %.2f ms\n",
        1e3 * first, 1e3 * second, second / first, 1e3 * each);
    std::filesystem::remove_all(copied);
  }

  const std::function<std::unique_ptr<Engine>()> open_;
  const int most_copies_;
  const MapStoreOptions options_;
  std::unique_ptr<Engine> engine_;
  std::unique_ptr<MapStore> maps_;
  SessionMap session_;
  int copies_ = 0, commits_ = 0;
};

// A store of a name, empty the first time.
using OpenStore = std::function<std::unique_ptr<Engine>(const std::string& name)>;

// Commits the same session into maps of all sizes in turns, and then reads the largest one.
void CompareSizes(const OpenStore& open, int most_copies) {
  std::vector<std::unique_ptr<Bench>> maps;
  for (const int copies : {1, 10, 50, 200}) {
    if (copies > most_copies) break;
    maps.push_back(std::make_unique<Bench>([open, copies] { return open(std::to_string(copies)); }, copies));
    maps.back()->Grow();
  }
  std::vector<std::vector<Bench::Spent>> spent(maps.size());
  for (int run = 0; run < kRuns; ++run) {
    for (size_t i = 0; i < maps.size(); ++i) {
      const size_t turn = (i + run) % maps.size();  // each goes first as often as the others
      spent[turn].push_back(maps[turn]->CommitSession());
    }
  }
  const auto median = [&](size_t map, double Bench::Spent::*field) {
    std::vector<double> values;
    for (const Bench::Spent& one : spent[map]) values.push_back(one.*field);
    return Median(values);
  };
  for (size_t i = 0; i < maps.size(); ++i) {
    const double seconds = median(i, &Bench::Spent::seconds), cpu = median(i, &Bench::Spent::cpu_seconds);
    std::vector<double> ratios;  // within a round, so that the machine's moods cancel out
    for (int run = 0; run < kRuns; ++run) ratios.push_back(spent[i][run].seconds / spent[0][run].seconds);
    std::printf(
        "%4dx: %9llu voxels in the map, commit %.1f ms (%.2f of 1x, median of rounds %.2f; merge and filter %.1f; CPU "
        "%.1f, %.2f of 1x), %.2f million voxels/s merged\n",
        maps[i]->copies(), static_cast<unsigned long long>(maps[i]->voxels()), 1e3 * seconds,
        seconds / median(0, &Bench::Spent::seconds), Median(ratios), 1e3 * median(i, &Bench::Spent::merge_seconds),
        1e3 * cpu, cpu / median(0, &Bench::Spent::cpu_seconds),
        1e-6 * static_cast<double>(maps[i]->session_voxels()) / seconds);
  }
  maps.erase(maps.begin(), maps.end() - 1);
  maps.front()->MeasureReads();
}

int Run(int count, char** arguments) {
  const bool rados = count == 5 && std::string(arguments[2]) == "--rados";
  const bool bounded = count == 4 && std::string(arguments[2]) == "--most";
  const bool memory = count == 3 && std::string(arguments[2]) == "--memory";
  const bool drive = count == 4 && std::string(arguments[2]) == "--drive";
  if (count != 2 && !rados && !bounded && !drive && !memory) {
    std::fprintf(stderr,
                 "usage: store_bench DIR [--rados CEPH_CONF POOL | --most COPIES | --memory | --drive KITTI_DIR]\n");
    return 2;
  }
  const std::string directory = arguments[1];
  if (drive) {
    std::filesystem::create_directories(directory);
    RunWholeSessions(directory, arguments[3]);
    std::filesystem::remove_all(directory);
    return 0;
  }
  if (memory) {
    const RocksDbOptions small{.block_cache_bytes = kSmallCache, .write_buffer_bytes = kSmallCache};
    const bool bounded_by_caches =
        Bench([&] { return Require(OpenRocksDbEngine(directory, small)); }, 40, {.block_cache_bytes = kSmallCache})
            .RunMemory();
    std::filesystem::remove_all(directory);
    return bounded_by_caches ? 0 : 1;
  }
  if (!rados) std::filesystem::create_directories(directory);
  PrintBytes();
  CompareSizes(
      [&](const std::string& name) -> std::unique_ptr<Engine> {
        if (!rados) return Require(OpenRocksDbEngine(directory + "/" + name));
        return Require(
            OpenRadosEngine({.conf = arguments[3], .pool = arguments[4], .name_space = directory + "." + name}));
      },
      rados     ? 50
      : bounded ? std::atoi(arguments[3])
                : 200);
  if (!rados) std::filesystem::remove_all(directory);
  return 0;
}

}  // namespace
}  // namespace mapkeep

int main(int count, char** arguments) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  return mapkeep::Run(count, arguments);
}
