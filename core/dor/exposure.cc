#include "core/dor/exposure.h"

#include <absl/strings/str_cat.h>
#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <atomic>
#include <mutex>
#include <utility>

#include "core/dor/scan_loop.h"
#include "core/dor/sub_voxels.h"
#include "core/voxels/ray_walk.h"

namespace mapkeep {
namespace {

constexpr double kCollected = 0.25;  // share of the first pass in the progress

// The sums are of integers, so that the order of the additions does not matter.
void Increment(uint32_t& count) { std::atomic_ref(count).fetch_add(1, std::memory_order_relaxed); }

// What one scan says about the bricks it touches. Kept a thread and reused: only touched bricks are cleared.
class ScanMarks {
 public:
  struct Marks {
    int32_t brick = 0;
    BrickBits hit{};
    BrickBits shielded{};  // hit, or beside a hit: the scan does not expose it
    BrickBits exposed{};
  };

  explicit ScanMarks(size_t bricks) : of_brick_(bricks, kNoBrick) {}

  Marks& Of(int32_t brick) {
    int32_t& local = of_brick_[brick];
    if (local == kNoBrick) {
      local = static_cast<int32_t>(marks_.size());
      marks_.push_back({.brick = brick});
    }
    return marks_[local];
  }

  const std::vector<Marks>& all() const { return marks_; }

  void Clear() {
    for (const Marks& marks : marks_) of_brick_[marks.brick] = kNoBrick;
    marks_.clear();
  }

  std::vector<VoxelIndex> voxels;  // of the scan's points
  std::vector<uint32_t> rays;      // points whose rays are walked

 private:
  std::vector<int32_t> of_brick_;
  std::vector<Marks> marks_;
};

// One scan against the voxels of the session.
class ScanCount {
 public:
  ScanCount(const Scan& scan, const Pose& pose, double voxel_size, const SessionVoxels& voxels,
            const ExposureParameters& parameters, ScanMarks& scratch)
      : scan_(scan),
        pose_(pose),
        voxel_size_(voxel_size),
        grid_(voxels.grid),
        masks_(voxels.masks),
        parameters_(parameters),
        scratch_(scratch) {}

  // Marks what the points hit and collects the rays to walk.
  void MarkHits() {
    scratch_.rays.clear();
    int32_t brick = kNoBrick;
    VoxelIndex corner;
    for (uint32_t i = 0; i < scratch_.voxels.size(); ++i) {
      const VoxelIndex& voxel = scratch_.voxels[i];
      const VoxelIndex of{voxel.x >> kBrickBits, voxel.y >> kBrickBits, voxel.z >> kBrickBits};
      if (brick == kNoBrick || of != corner) {
        brick = grid_.FindBrick(of.x, of.y, of.z);
        corner = of;
      }
      const uint64_t bit = BitInLayer(voxel.x, voxel.y);
      ScanMarks::Marks& marks = scratch_.Of(brick);
      const int layer = LayerInBrick(voxel.z);
      const bool is_new = (marks.hit[layer] & bit) == 0;
      if (is_new || parameters_.engine == ExposureEngine::kExact) scratch_.rays.push_back(i);
      if (!is_new) continue;
      marks.hit[layer] |= bit;
      marks.shielded[layer] |= bit;
      if (parameters_.neighbour_hits) ShieldAround(voxel, brick);
    }
  }

  void WalkRays(const VoxelIndex& sensor) {
    const Eigen::Vector3d from = pose_.translation() / voxel_size_;
    for (const uint32_t ray : scratch_.rays) WalkRay(from, sensor, World(ray) / voxel_size_, scratch_.voxels[ray]);
  }

 private:
  Eigen::Vector3d World(uint32_t point) const { return pose_ * scan_.points[point].cast<double>(); }

  // The 8 voxels around in the same layer.
  void ShieldAround(const VoxelIndex& voxel, int32_t brick) {
    const int layer = LayerInBrick(voxel.z);
    const int x = voxel.x & (kBrickSize - 1), y = voxel.y & (kBrickSize - 1);
    if (x > 0 && x < kBrickSize - 1 && y > 0 && y < kBrickSize - 1) {
      scratch_.Of(brick).shielded[layer] |= uint64_t{0x070707} << (x - 1 + kBrickSize * (y - 1));
      return;
    }
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const VoxelIndex at{voxel.x + dx, voxel.y + dy, voxel.z};
        const int32_t of = grid_.FindBrick(at.x >> kBrickBits, at.y >> kBrickBits, at.z >> kBrickBits);
        if (of != kNoBrick) scratch_.Of(of).shielded[layer] |= BitInLayer(at.x, at.y);
      }
    }
  }

  // Exposes voxels between the sensor and the point, skipping space where the session has none. Lengths in voxel edges.
  void WalkRay(const Eigen::Vector3d& from, const VoxelIndex& first, const Eigen::Vector3d& to,
               const VoxelIndex& last) {
    const Eigen::Vector3d along = to - from;
    const double end = 1 - parameters_.margin_by_range;
    RayWalk walk(from, first, to, last);
    while (!walk.done() && walk.entry_time() < end) {
      const auto [x, y, z] = walk.at();
      const int32_t block = grid_.FindBlock(x >> kBlockBits, y >> kBlockBits, z >> kBlockBits);
      if (block == kNoBrick) {
        walk.LeaveCube(kBlockBits);
        continue;
      }
      const int32_t brick = grid_.BrickInBlock(block, x >> kBrickBits, y >> kBrickBits, z >> kBrickBits);
      if (brick == kNoBrick) {
        walk.LeaveCube(kBrickBits);
        continue;
      }
      ScanMarks::Marks& marks = scratch_.Of(brick);
      const BrickBits& occupied = grid_.bits(brick);
      const VoxelIndex in{x >> kBrickBits, y >> kBrickBits, z >> kBrickBits};
      do {
        const auto& at = walk.at();
        const int layer = LayerInBrick(at[2]);
        const uint64_t bit = BitInLayer(at[0], at[1]);
        const bool open = (occupied[layer] & ~marks.shielded[layer] & ~marks.exposed[layer] & bit) != 0;
        if (open && walk.exit_time() <= end) {
          const uint64_t mask = masks_[grid_.IdInBrick(brick, layer, bit)];
          // A watched voxel without points has no sub-voxels to look through: any ray exposes it.
          const bool seen =
              !parameters_.sub_voxels || mask == 0 ||
              PassesSubVoxels(mask, {at[0], at[1], at[2]}, from, along, walk.entry_time(), walk.exit_time());
          if (seen) marks.exposed[layer] |= bit;
        }
        walk.Step();
      } while (!walk.done() && walk.at()[0] >> kBrickBits == in.x && walk.at()[1] >> kBrickBits == in.y &&
               walk.at()[2] >> kBrickBits == in.z);
    }
  }

  const Scan& scan_;
  const Pose& pose_;
  const double voxel_size_;
  const VoxelGrid& grid_;
  const std::vector<uint64_t>& masks_;
  const ExposureParameters& parameters_;
  ScanMarks& scratch_;
};

void AddScan(const VoxelGrid& grid, const ScanMarks& scratch, VoxelCounts& counts) {
  for (const ScanMarks::Marks& marks : scratch.all()) {
    for (int layer = 0; layer < kBrickSize; ++layer) {
      for (uint64_t rest = marks.hit[layer]; rest != 0; rest &= rest - 1) {
        Increment(counts.hits[grid.IdInBrick(marks.brick, layer, rest & -rest)]);
      }
      for (uint64_t rest = marks.exposed[layer]; rest != 0; rest &= rest - 1) {
        Increment(counts.exposures[grid.IdInBrick(marks.brick, layer, rest & -rest)]);
      }
    }
  }
}

// Calls visit(voxel, mask) for the eight voxels of a brick of sub-voxels that have a point.
template <typename Visit>
void ForEachVoxelOf(const BrickBits& bits, const VoxelIndex& corner, const Visit& visit) {
  for (int i = 0; i < 8; ++i) {
    const int x = i & 1, y = i >> 1 & 1, z = i >> 2;
    uint64_t mask = 0;
    for (int sub_z = 0; sub_z < 4; ++sub_z) {
      const uint64_t layer = bits[4 * z + sub_z] >> (4 * x + 32 * y);  // rows of 8 bits, of which 4 are the voxel's
      const uint64_t rows = (layer & 0xf) | (layer >> 4 & 0xf0) | (layer >> 8 & 0xf00) | (layer >> 12 & 0xf000);
      mask |= rows << (16 * sub_z);
    }
    if (mask != 0) visit(VoxelIndex{(corner.x >> 2) + x, (corner.y >> 2) + y, (corner.z >> 2) + z}, mask);
  }
}

}  // namespace

absl::StatusOr<SessionVoxels> CollectVoxels(const ScanSource& scans, std::span<const Pose> poses, double voxel_size,
                                            std::span<const VoxelKey> watched, const ProgressPart& progress) {
  VoxelGrid fine;    // of sub-voxels, a quarter of the edge
  std::mutex mutex;  // guards it; a scan is gathered first, so that the lock is held for its bricks only
  tbb::enumerable_thread_specific<std::pair<VoxelGrid, std::vector<VoxelIndex>>> scratches;
  const auto collect = [&](size_t index, const Scan& scan) -> absl::Status {
    auto& [mine, sub_voxels] = scratches.local();
    if (auto status = SubVoxelsOfScan(scan, poses[index], voxel_size, sub_voxels); !status.ok()) return status;
    mine.Clear();
    for (const VoxelIndex& sub_voxel : sub_voxels) mine.Insert(sub_voxel);
    const std::lock_guard lock(mutex);
    fine.Merge(mine);
    return absl::OkStatus();
  };
  if (auto status = ForEachScan(scans, progress, collect); !status.ok()) return status;

  SessionVoxels voxels;
  for (size_t brick = 0; brick < fine.brick_count(); ++brick) {
    ForEachVoxelOf(fine.bits(static_cast<int32_t>(brick)), fine.CornerOfBrick(static_cast<int32_t>(brick)),
                   [&](const VoxelIndex& voxel, uint64_t) { voxels.grid.Insert(voxel); });
  }
  for (const VoxelKey key : watched) voxels.grid.Insert(VoxelIndexOf(key));
  voxels.grid.Finish();
  voxels.masks.resize(voxels.grid.size());
  for (size_t brick = 0; brick < fine.brick_count(); ++brick) {
    ForEachVoxelOf(fine.bits(static_cast<int32_t>(brick)), fine.CornerOfBrick(static_cast<int32_t>(brick)),
                   [&](const VoxelIndex& voxel, uint64_t mask) { voxels.masks[voxels.grid.Find(voxel)] = mask; });
  }
  return voxels;
}

absl::StatusOr<VoxelCounts> CountVoxels(const ScanSource& scans, std::span<const Pose> poses, double voxel_size,
                                        const SessionVoxels& voxels, const ExposureParameters& parameters,
                                        const ProgressPart& progress) {
  const VoxelGrid& grid = voxels.grid;
  VoxelCounts counts{.hits = std::vector<uint32_t>(grid.size()), .exposures = std::vector<uint32_t>(grid.size())};
  tbb::enumerable_thread_specific<ScanMarks> scratches([&] { return ScanMarks(grid.brick_count()); });
  const auto count = [&](size_t index, const Scan& scan) -> absl::Status {
    ScanMarks& scratch = scratches.local();
    if (auto status = VoxelsOfScan(scan, poses[index], voxel_size, scratch.voxels); !status.ok()) return status;
    const auto sensor = VoxelIndexOf(poses[index].translation(), voxel_size);
    if (!sensor.ok()) return {sensor.status().code(), absl::StrCat("its sensor position: ", sensor.status().message())};
    ScanCount scan_count(scan, poses[index], voxel_size, voxels, parameters, scratch);
    scan_count.MarkHits();
    scan_count.WalkRays(*sensor);
    AddScan(grid, scratch, counts);
    scratch.Clear();
    return absl::OkStatus();
  };
  if (auto status = ForEachScan(scans, progress, count); !status.ok()) return status;
  return counts;
}

Evidence EvidenceOf(const VoxelGrid& grid, const VoxelCounts& counts, double voxel_size) {
  Evidence evidence{.voxel_size = voxel_size};
  std::vector<uint32_t> ids;
  grid.SortByKey(evidence.keys, ids);
  evidence.hits.resize(ids.size());
  evidence.exposures.resize(ids.size());
  for (size_t i = 0; i < ids.size(); ++i) {
    evidence.hits[i] = counts.hits[ids[i]];
    evidence.exposures[i] = counts.exposures[ids[i]];
  }
  return evidence;
}

absl::StatusOr<Evidence> CountEvidence(const ScanSource& scans, std::span<const Pose> poses, double voxel_size,
                                       std::span<const VoxelKey> watched, const Progress& progress,
                                       const ExposureParameters& parameters) {
  if (auto status = CheckSession(scans, poses); !status.ok()) return status;
  const auto voxels = CollectVoxels(scans, poses, voxel_size, watched, {progress, 0, kCollected});
  if (!voxels.ok()) return voxels.status();
  const auto counts = CountVoxels(scans, poses, voxel_size, *voxels, parameters, {progress, kCollected, 1});
  if (!counts.ok()) return counts.status();
  return EvidenceOf(voxels->grid, *counts, voxel_size);
}

}  // namespace mapkeep
