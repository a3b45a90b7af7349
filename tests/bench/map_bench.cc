// map_bench KITTI_DIR OUT.bin [FIRST:LAST ...]
// The stages between alignment and storage, in memory: each range of frames (both ends inclusive; all, if none is
// given) is a session that is cleaned, made a ratio map, merged and filtered. Writes the sub-voxel points of the static
// voxels as float32 x y z 0 for score_dor.py and prints the seconds of each stage.

#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <cstdio>
#include <map>
#include <numeric>
#include <set>

#include "core/dor/remover.h"
#include "core/ratio_map/map_filter.h"
#include "core/ratio_map/merge.h"
#include "core/ratio_map/session_map.h"
#include "tests/bench/kitti_directory.h"

namespace mapkeep {
namespace {

using BlockMap = std::map<BlockKey, Block>;

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

std::set<BlockKey> Merge(BlockMap& map, const SessionMap& session) {
  std::set<BlockKey> touched;
  for (auto begin = session.voxels.begin(); begin != session.voxels.end();) {
    const BlockKey key = BlockKeyOf(begin->key);
    const auto end = std::find_if(begin, session.voxels.end(),
                                  [key](const SessionVoxel& voxel) { return BlockKeyOf(voxel.key) != key; });
    Block& block = map.try_emplace(key, Block{.key = key}).first->second;
    block = MergeBlock(block, {begin, end}, session, {});
    touched.insert(key);
    begin = end;
  }
  return touched;
}

size_t Filter(BlockMap& map, const std::set<BlockKey>& touched) {
  std::set<BlockKey> affected;
  for (const BlockKey key : touched) {
    for (const VoxelIndex& at : NeighbourhoodOf(BlockIndexOf(key))) {
      if (map.contains(BlockKeyOf(at))) affected.insert(BlockKeyOf(at));
    }
  }
  const std::vector<BlockKey> keys(affected.begin(), affected.end());
  std::vector<std::vector<MapVerdict>> verdicts(keys.size());
  tbb::parallel_for(size_t{0}, keys.size(), [&](size_t i) {
    BlockNeighbourhood blocks{};
    const auto around = NeighbourhoodOf(BlockIndexOf(keys[i]));
    for (int n = 0; n < 27; ++n) {
      const auto found = map.find(BlockKeyOf(around[n]));
      if (found != map.end()) blocks[n] = &found->second;
    }
    verdicts[i] = FilterBlock(blocks, {});
  });
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
int AddSession(const KittiDirectory& directory, size_t first, size_t last, uint32_t day, BlockMap& map) {
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
  const auto touched = Merge(map, *session);
  const double merge = watch.Lap();
  const size_t filtered = Filter(map, touched);
  std::printf(
      "frames %zu to %zu: remove %.2f s, session map %.2f s, merge %.3f s, filter %.3f s (%zu blocks), N_max %.0f\n",
      first, last, remove, build, merge, watch.Lap(), filtered, session->n_max);
  return 0;
}

int Run(int count, char** arguments) {
  if (count < 3) {
    std::fprintf(stderr, "usage: map_bench KITTI_DIR OUT.bin [FIRST:LAST ...]\n");
    return 2;
  }
  const KittiDirectory directory(arguments[1]);
  BlockMap map;
  if (count == 3 && AddSession(directory, 0, directory.poses.size() - 1, 0, map) != 0) return 1;
  for (int i = 3; i < count; ++i) {
    size_t first = 0, last = 0;
    if (std::sscanf(arguments[i], "%zu:%zu", &first, &last) != 2 || last < first || last >= directory.poses.size()) {
      std::fprintf(stderr, "%s: expected FIRST:LAST within 0:%zu\n", arguments[i], directory.poses.size() - 1);
      return 2;
    }
    if (AddSession(directory, first, last, static_cast<uint32_t>(i), map) != 0) return 1;
  }
  Write(map, 0.2, false, arguments[2]);
  Write(map, 0.2, true, std::string(arguments[2]) + ".all.bin");
  return 0;
}

}  // namespace
}  // namespace mapkeep

int main(int count, char** arguments) { return mapkeep::Run(count, arguments); }
