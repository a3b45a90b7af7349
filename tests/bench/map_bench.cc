// map_bench KITTI_DIR OUT.bin [FIRST:LAST ...]
// The stages between alignment and storage, in memory: each range of frames (both ends inclusive; all, if none is
// given) is a session that is cleaned, made a ratio map, merged and filtered. Writes the sub-voxel points of the static
// voxels as float32 x y z 0 for score_dor.py and prints the seconds of each stage.

#include <tbb/parallel_for.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <bit>
#include <chrono>
#include <cstdio>
#include <iterator>
#include <map>
#include <numeric>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "core/dor/remover.h"
#include "core/ratio_map/forgetting.h"
#include "core/ratio_map/map_filter.h"
#include "core/ratio_map/merge.h"
#include "core/ratio_map/remnants.h"
#include "core/ratio_map/session_map.h"
#include "tests/bench/kitti_directory.h"

namespace mapkeep {
namespace {

using BlockMap = std::map<BlockKey, Block>;

struct Rules {
  MergeParameters merge;
  MapFilterParameters filter;
};

class Stopwatch {
 public:
  // Seconds since the last call, or since it was made.
  double Lap() {
    const auto now = std::chrono::steady_clock::now();
    const double seconds = std::chrono::duration<double>(now - last_).count();
    last_ = now;
    return seconds;
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

std::vector<VoxelKey> KeysOf(const BlockMap& map) {
  std::vector<VoxelKey> keys;
  for (const auto& [key, block] : map) {
    for (const Voxel& voxel : block.voxels) keys.push_back(VoxelKeyOf(key, voxel.position));
  }
  return keys;
}

// Calls visit(n, entry) for what a table has of a block and its neighbours.
template <typename Table, typename Visit>
void ForEachAround(const Table& table, BlockKey key, const Visit& visit) {
  const auto around = NeighbourhoodOf(BlockIndexOf(key));
  for (int n = 0; n < 27; ++n) {
    if (const auto found = table.find(BlockKeyOf(around[n])); found != table.end()) visit(n, found->second);
  }
}

BlockNeighbourhood BlocksAround(const BlockMap& map, BlockKey key) {
  BlockNeighbourhood blocks{};
  ForEachAround(map, key, [&](int n, const Block& block) { blocks[n] = &block; });
  return blocks;
}

std::set<BlockKey> Merge(BlockMap& map, const SessionMap& session, const MergeParameters& parameters) {
  std::map<BlockKey, std::span<const SessionVoxel>> of_block;
  for (auto begin = session.voxels.begin(); begin != session.voxels.end();) {
    const BlockKey key = BlockKeyOf(begin->key);
    const auto end = std::find_if(begin, session.voxels.end(),
                                  [key](const SessionVoxel& voxel) { return BlockKeyOf(voxel.key) != key; });
    of_block[key] = {begin, end};
    begin = end;
  }
  std::map<BlockKey, Departed> departed;
  std::map<BlockKey, std::vector<SessionVoxel>> news;  // without what is left of what moved
  for (const auto& [key, voxels] : of_block) {
    SessionNeighbourhood around;
    ForEachAround(of_block, key, [&](int n, std::span<const SessionVoxel> of) { around[n] = of; });
    departed[key] = DepartedFrom(BlocksAround(map, key), around, session.voxel_size, parameters);
    const std::vector<uint16_t> remnants = RemnantsIn(BlocksAround(map, key), around, parameters);
    std::ranges::copy_if(voxels, std::back_inserter(news[key]), [&](const SessionVoxel& voxel) {
      return !std::ranges::binary_search(remnants, PositionInBlock(voxel.key));
    });
  }
  std::set<BlockKey> touched;
  for (const auto& [key, voxels] : of_block) {
    std::array<const Departed*, 27> around{};
    ForEachAround(departed, key, [&](int n, const Departed& of) { around[n] = &of; });
    Block& block = map.try_emplace(key, Block{.key = key}).first->second;
    block = MergeBlock(Remembered(block, around, voxels), news[key], session, parameters);
    touched.insert(key);
  }
  return touched;
}

size_t Filter(BlockMap& map, const std::set<BlockKey>& touched, const MapFilterParameters& parameters) {
  std::set<BlockKey> affected;
  for (const BlockKey key : touched) {
    for (const VoxelIndex& at : NeighbourhoodOf(BlockIndexOf(key))) {
      if (map.contains(BlockKeyOf(at))) affected.insert(BlockKeyOf(at));
    }
  }
  const std::vector<BlockKey> keys(affected.begin(), affected.end());
  std::vector<std::vector<MapVerdict>> verdicts(keys.size());
  tbb::parallel_for(size_t{0}, keys.size(),
                    [&](size_t i) { verdicts[i] = FilterBlock(BlocksAround(map, keys[i]), parameters); });
  for (size_t i = 0; i < keys.size(); ++i) {
    Block& block = map.at(keys[i]);
    for (size_t v = 0; v < block.voxels.size(); ++v) block.voxels[v].is_static = verdicts[i][v] == MapVerdict::kStatic;
  }
  return keys.size();
}

void Write(const BlockMap& map, double voxel_size, bool all, const std::string& path) {
  std::ofstream file(path, std::ios::binary);
  size_t voxels = 0, kept = 0, points = 0;
  for (const auto& [key, block] : map) {
    for (const Voxel& voxel : block.voxels) {
      ++voxels;
      if (!all && !voxel.is_static) continue;
      ++kept;
      for (const Eigen::Vector3d& point : SubVoxelPoints(block, voxel, voxel_size)) {
        const float row[4]{static_cast<float>(point.x()), static_cast<float>(point.y()), static_cast<float>(point.z()),
                           0};
        file.write(reinterpret_cast<const char*>(row), sizeof row);
        ++points;
      }
    }
  }
  std::printf("map: %zu blocks, %zu voxels, %zu static, %zu points\n", map.size(), voxels, kept, points);
}

int Fail(const absl::Status& status) {
  std::fprintf(stderr, "%s\n", status.ToString().c_str());
  return 1;
}

// `day` is when the session began.
int AddSession(const KittiDirectory& directory, size_t first, size_t last, uint32_t day, const Rules& rules,
               BlockMap& map) {
  std::vector<size_t> frames(last - first + 1);
  std::iota(frames.begin(), frames.end(), first);
  const ScanSource scans = directory.Source(frames);
  const std::span poses = std::span(directory.poses).subspan(first, frames.size());
  Stopwatch watch;
  const auto removal = RemoveDynamicObjects(scans, poses, KeysOf(map), {});
  if (!removal.ok()) return Fail(removal.status());
  const double remove = watch.Lap();
  const auto session =
      BuildSessionMap(scans, poses, [&](size_t index, const Scan& scan) { return removal->Label(index, scan); },
                      removal->evidence(), 1440 * day, {});
  if (!session.ok()) return Fail(session.status());
  const double build = watch.Lap();
  const auto touched = Merge(map, *session, rules.merge);
  const double merge = watch.Lap();
  const size_t filtered = Filter(map, touched, rules.filter);
  std::printf(
      "frames %zu to %zu: remove %.2f s, session map %.2f s, merge %.3f s, filter %.3f s (%zu blocks), N_max %.0f\n",
      first, last, remove, build, merge, watch.Lap(), filtered, session->n_max);
  return 0;
}

int Run(int count, char** arguments) {
  CLI::App app("Makes a map of a drive, in one session or several");
  std::string in, out;
  std::vector<std::string> ranges;
  Rules rules;
  app.add_option("KITTI_DIR", in)->required();
  app.add_option("OUT.bin", out, "Static points; OUT.bin.all.bin gets all of them")->required();
  app.add_option("FIRST:LAST", ranges, "Frames of each session; none: one session of all frames");
  app.add_option("--probation", rules.filter.probation_height, "As filter.probation_height, metres; 0: nothing waits")
      ->capture_default_str();
  app.add_option("--remnant-share", rules.merge.remnant_share, "As merge.remnant_share; 1: off")->capture_default_str();
  app.add_option("--probation-hits", rules.filter.probation_hits, "As filter.probation_hits")->capture_default_str();
  app.add_option("--enclosure", rules.filter.enclosure_reach, "As filter.enclosure_reach, metres; 0: off")
      ->capture_default_str();
  app.add_option("--cohort", rules.merge.cohort_looked_through, "As merge.cohort_looked_through; above 1: off")
      ->capture_default_str();
  CLI11_PARSE(app, count, arguments);
  const KittiDirectory directory(in);
  BlockMap map;
  if (ranges.empty() && AddSession(directory, 0, directory.poses.size() - 1, 0, rules, map) != 0) return 1;
  uint32_t day = 0;
  for (const std::string& range : ranges) {
    size_t first = 0, last = 0;
    if (std::sscanf(range.c_str(), "%zu:%zu", &first, &last) != 2 || last < first || last >= directory.poses.size()) {
      std::fprintf(stderr, "%s: expected FIRST:LAST within 0:%zu\n", range.c_str(), directory.poses.size() - 1);
      return 2;
    }
    if (AddSession(directory, first, last, ++day, rules, map) != 0) return 1;
  }
  Write(map, 0.2, false, out);
  Write(map, 0.2, true, out + ".all.bin");
  return 0;
}

}  // namespace
}  // namespace mapkeep

int main(int count, char** arguments) { return mapkeep::Run(count, arguments); }
