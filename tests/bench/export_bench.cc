// Points a second and the client's peak memory for every export of one synthetic map, through a real daemon and the
// real command line. The map comes in by `mapkeep import`, which is measured likewise.

#include <absl/strings/str_format.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <bit>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "client/archive/map_archive.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

constexpr int32_t kBlocksAcross = 32;

/// A plain with a house wall in every second block; about five points a voxel, as in real maps.
uint64_t WriteMap(const fs::path& file, uint64_t points_wanted) {
  std::mt19937_64 random(1);
  std::vector<Block> blocks;
  uint64_t points = 0;
  for (int32_t i = 0; points < points_wanted; ++i) {
    Block block{BlockKeyOf(VoxelIndex{i % kBlocksAcross - kBlocksAcross / 2, i / kBlocksAcross, 0}), {}};
    for (uint16_t position = 0; position < 32768; ++position) {
      const int x = position & 31, y = position >> 5 & 31, z = position >> 10;
      const bool ground = z == 1, wall = i % 2 == 0 && y == 16 && z > 1 && x > 4;
      if (!ground && !wall) continue;
      const uint64_t mask = ground ? (random() & 0xffff) | 1 : (random() & 0x000f'000f'000f'000f) | 1;
      points += std::popcount(mask);
      block.voxels.push_back({.position = position,
                              .hits = static_cast<uint16_t>(8 + random() % 800),
                              .exposures = static_cast<uint16_t>(random() % 80),
                              .ground = ground,
                              .is_static = true,
                              .mean = {static_cast<uint8_t>(random()), static_cast<uint8_t>(random()), 100},
                              .normal = {static_cast<uint8_t>(random()), 200},
                              .intensity = static_cast<uint8_t>(random()),
                              .mask = mask,
                              .first_seen = 13'889'280,
                              .last_seen = static_cast<uint32_t>(13'889'280 + 1440 * (random() % 9))});
    }
    blocks.push_back(std::move(block));
  }
  std::ranges::sort(blocks, {}, &Block::key);
  std::ofstream stream(file, std::ios::binary);
  ArchiveWriter writer(stream, {.voxel_size = 0.2, .origin = Eigen::Vector3d(500000, 5400000, 0), .crs = "EPSG:25832"});
  for (const Block& block : blocks) {
    if (!writer.Add(block).ok()) std::abort();
  }
  if (!writer.Finish().ok()) std::abort();
  return points;
}

pid_t Start(const std::vector<std::string>& words, bool quiet) {
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  const pid_t pid = fork();
  if (pid != 0) return pid;
  if (quiet) {
    for (const int fd : {STDOUT_FILENO, STDERR_FILENO}) {
      if (std::freopen("/dev/null", "w", fd == STDOUT_FILENO ? stdout : stderr) == nullptr) _exit(126);
    }
  }
  execv(arguments[0], arguments.data());
  _exit(127);
}

struct Run {
  double seconds = 0, cpu_seconds = 0, peak_mb = 0;
  bool ok = false;
};

Run Measure(const std::vector<std::string>& words) {
  const auto began = std::chrono::steady_clock::now();
  const pid_t pid = Start(words, false);
  int status = 0;
  rusage usage{};
  wait4(pid, &status, 0, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return {.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count(),
          .cpu_seconds = seconds(usage.ru_utime) + seconds(usage.ru_stime),
          .peak_mb = static_cast<double>(usage.ru_maxrss) / 1024,
          .ok = WIFEXITED(status) && WEXITSTATUS(status) == 0};
}

/// A daemon on a store of its own, killed at the end.
class Daemon {
 public:
  explicit Daemon(const fs::path& directory) {
    const fs::path ports = directory / "ports.json";
    pid_ = Start({MAPKEEPD, "--data", (directory / "data").string(), "--listen", "127.0.0.1:0", "--admin",
                  "127.0.0.1:0", "--ports-file", ports.string()},
                 true);
    for (int i = 0; i < 600 && !fs::exists(ports); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(50));
    std::ifstream stream(ports);
    server_ = nlohmann::json::parse(stream)["listen"].get<std::string>();
  }
  ~Daemon() {
    kill(pid_, SIGTERM);
    waitpid(pid_, nullptr, 0);
  }
  Daemon(const Daemon&) = delete;
  Daemon& operator=(const Daemon&) = delete;
  const std::string& server() const { return server_; }

 private:
  pid_t pid_ = 0;
  std::string server_;
};

int Main(int count, char** arguments) {
  uint64_t points_wanted = 5'000'000;
  std::vector<std::string> only;
  std::string write;
  CLI::App app("Measures every export of a synthetic map");
  app.add_option("--points", points_wanted, "At least so many points")->capture_default_str();
  app.add_option("--only", only, "Formats; by default all");
  app.add_option("--write", write, "Only write the map into this file, for `mapkeep import`, and say its points");
  CLI11_PARSE(app, count, arguments);
  if (!write.empty()) {
    std::printf("%s\n", absl::StrFormat("%d", WriteMap(write, points_wanted)).c_str());
    return 0;
  }

  const fs::path directory = fs::temp_directory_path() / absl::StrFormat("mapkeep-export-bench-%d", getpid());
  fs::create_directories(directory);
  const fs::path archive = directory / "map.mkmap";
  const auto points = static_cast<double>(WriteMap(archive, points_wanted));
  bool all_ok = true;
  {
    const Daemon daemon(directory);
    const auto print = [&](const std::string& name, const Run& run, uint64_t bytes) {
      all_ok = all_ok && run.ok;
      std::printf("%-16s %9.2f %13.2f %10.2f %9.0f %9.0f%s\n", name.c_str(), run.seconds, points / run.seconds / 1e6,
                  run.cpu_seconds, run.peak_mb, static_cast<double>(bytes) / 1e6, run.ok ? "" : "  FAILED");
      std::fflush(stdout);
    };
    std::printf("%.2f million points\n%-16s %9s %13s %10s %9s %9s\n", points / 1e6, "", "seconds", "Mpoints/s",
                "client CPU", "client MB", "file MB");
    const std::vector<std::string> client = {MAPKEEP, "--server", daemon.server(), "--json"};
    const auto with = [&client](std::vector<std::string> words) {
      words.insert(words.begin(), client.begin(), client.end());
      return words;
    };
    print("import", Measure(with({"import", "m", archive.string()})), fs::file_size(archive));
    for (const char* name : {"pcd", "pcd compressed", "ply", "las", "autoware", "bt", "glb", "3dtiles", "mkmap"}) {
      if (!only.empty() && std::ranges::find(only, name) == only.end()) continue;
      const fs::path out = directory / "out";
      std::vector<std::string> words = {"export", "m", out.string(), "--format",
                                        std::string(name).substr(0, std::string(name).find(' '))};
      if (std::string(name).ends_with("compressed")) words.emplace_back("--compressed");
      const Run run = Measure(with(words));
      uint64_t bytes = 0;
      if (fs::is_directory(out)) {
        for (const auto& entry : fs::recursive_directory_iterator(out))
          bytes += entry.is_regular_file() ? entry.file_size() : 0;
      } else if (fs::exists(out)) {
        bytes = fs::file_size(out);
      }
      print(name, run, bytes);
      fs::remove_all(out);
    }
  }
  fs::remove_all(directory);
  return all_ok ? 0 : 1;
}

}  // namespace
}  // namespace mapkeep

int main(int count, char** arguments) { return mapkeep::Main(count, arguments); }
