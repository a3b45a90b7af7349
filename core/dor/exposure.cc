#include "core/dor/exposure.h"

#include <absl/strings/str_cat.h>
#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <mutex>
#include <numbers>
#include <numeric>
#include <utility>

#include "core/dor/ray_bins.h"
#include "core/dor/scan_loop.h"
#include "core/dor/sub_voxels.h"
#include "core/voxels/ray_walk.h"

namespace mapkeep {
namespace {

constexpr double kCollected = 0.25;  // share of the first pass in the progress

// What one scan says about the bricks it touches. Kept a thread and reused: only touched bricks are cleared.
class ScanMarks {
 public:
  struct Marks {
    int32_t brick = 0;
    BrickBits hit{};
    BrickBits shielded{};  // hit, or beside a hit: the scan does not expose it
    BrickBits exposed{};
    BrickBits confirmed{};  // of the exposed
    BrickBits clear{};
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

  // The marks of a brick, or nullptr where the scan has left none.
  const Marks* Find(int32_t brick) const {
    const int32_t local = of_brick_[brick];
    return local == kNoBrick ? nullptr : &marks_[local];
  }

  std::vector<VoxelIndex> voxels;             // of the scan's points
  std::vector<Eigen::Vector3d> positions;     // of the points, in voxel edges
  std::array<std::vector<float>, 3> to_ends;  // from the sensor to the points, in voxel edges
  RayBins bins;

  // Voxels that wait for the rays to be asked about them: where their marks go.
  struct Asked {
    int32_t brick = 0;
    int32_t layer = 0;
    uint64_t bit = 0;
  };
  std::vector<Asked> asked;
  RayTargets targets;
  std::vector<uint8_t> seen;

 private:
  std::vector<int32_t> of_brick_;
  std::vector<Marks> marks_;
};

// One scan against the voxels of the session.
class ScanCount {
 public:
  // The scratch holds the points' voxels and positions; `sensor` is in voxel edges too.
  ScanCount(const Eigen::Vector3d& sensor, const SessionVoxels& voxels, const std::vector<BoxCode>& boxes,
            double voxel_size, const ExposureParameters& parameters, ScanMarks& scratch)
      : grid_(voxels.grid),
        masks_(voxels.masks),
        boxes_(boxes),
        parameters_(parameters),
        from_(sensor),
        end_(static_cast<float>(1 - parameters.margin_by_range)),
        clearance_{static_cast<float>(parameters.clear_around / voxel_size),
                   static_cast<float>(parameters.clear_behind / voxel_size)},
        scratch_(scratch) {}

  // Marks what the points hit.
  void MarkHits() {
    int32_t brick = kNoBrick;
    VoxelIndex corner;
    for (const VoxelIndex& voxel : scratch_.voxels) {
      const VoxelIndex of{voxel.x >> kBrickBits, voxel.y >> kBrickBits, voxel.z >> kBrickBits};
      if (brick == kNoBrick || of != corner) {
        brick = grid_.FindBrick(of.x, of.y, of.z);
        corner = of;
      }
      const uint64_t bit = BitInLayer(voxel.x, voxel.y);
      const int layer = LayerInBrick(voxel.z);
      ScanMarks::Marks& marks = scratch_.Of(brick);
      if ((marks.hit[layer] & bit) != 0) continue;
      marks.hit[layer] |= bit;
      marks.shielded[layer] |= bit;
      if (parameters_.neighbour_hits) ShieldAround(voxel, brick);
    }
  }

  // The reference: walks the ray of every point.
  void WalkRays(const VoxelIndex& sensor) {
    for (size_t i = 0; i < scratch_.voxels.size(); ++i) {
      const Eigen::Vector3d to_end = scratch_.positions[i] - from_;
      WalkRay(sensor, to_end, Ray(to_end), scratch_.voxels[i]);
    }
  }

  // Asks for every voxel that the scan might see what the rays say about it, without walking any; of the answers those
  // in `wanted` count.
  void AskVoxels(uint8_t wanted) {
    for (int axis = 0; axis < 3; ++axis) {
      std::vector<float>& ends = scratch_.to_ends[axis];
      ends.resize(scratch_.positions.size());
      for (size_t i = 0; i < ends.size(); ++i) ends[i] = static_cast<float>(scratch_.positions[i][axis] - from_[axis]);
    }
    scratch_.bins.Build(scratch_.to_ends, end_);
    for (const BlockBricks& block : grid_.blocks()) {
      if (!MayReachCube(block.corner, kBlockSize)) continue;
      for (int32_t brick = block.first; brick < block.end; ++brick) {
        if (!MayReachCube(grid_.CornerOfBrick(brick), kBrickSize)) continue;
        AskBrick(brick);
        if (scratch_.asked.size() >= kBatch) TakeAnswers(wanted);
      }
    }
    TakeAnswers(wanted);
  }

 private:
  static constexpr size_t kBatch = 1024;  // voxels asked for at once
  static constexpr int kSparse = 3;       // occupied sub-voxels, of 64

  std::array<float, 3> FromSensor(const VoxelIndex& corner) const {
    return {static_cast<float>(corner.x - from_.x()), static_cast<float>(corner.y - from_.y()),
            static_cast<float>(corner.z - from_.z())};
  }

  // `cube` is the voxel's brick, seen from the sensor.
  RayTarget TargetOf(const std::array<float, 3>& cube, int x, int y, int z, uint32_t id) const {
    return {cube, {x, y, z}, masks_[id], boxes_[id]};
  }

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

  void WalkRay(const VoxelIndex& sensor, const Eigen::Vector3d& to_end, const Ray& ray, const VoxelIndex& last) {
    RayWalk walk(from_, sensor, from_ + to_end, last);
    while (!walk.done() && walk.entry_time() < end_) {
      const auto [x, y, z] = walk.at();
      const int32_t brick = grid_.FindBrick(x >> kBrickBits, y >> kBrickBits, z >> kBrickBits);
      if (brick == kNoBrick) {
        walk.LeaveCube(kBrickBits);
        continue;
      }
      const int layer = LayerInBrick(z);
      const uint64_t bit = BitInLayer(x, y);
      ScanMarks::Marks& marks = scratch_.Of(brick);
      if ((grid_.bits(brick)[layer] & ~marks.shielded[layer] & ~marks.exposed[layer] & bit) != 0) {
        const RayTarget target = TargetOf(FromSensor(grid_.CornerOfBrick(brick)), x & (kBrickSize - 1),
                                          y & (kBrickSize - 1), layer, grid_.IdInBrick(brick, layer, bit));
        if (SeesThrough(ray, target, end_)) marks.exposed[layer] |= bit;
      }
      walk.Step();
    }
  }

  bool MayReachCube(const VoxelIndex& corner, int32_t size) const {
    const double half = 0.5 * size;
    return scratch_.bins.MayReach(
        {{static_cast<float>(corner.x + half - from_.x()), static_cast<float>(corner.y + half - from_.y()),
          static_cast<float>(corner.z + half - from_.z())},
         static_cast<float>(1.001 * size / std::numbers::sqrt2),
         static_cast<float>(1.001 * half)});
  }

  void AskBrick(int32_t brick) {
    const ScanMarks::Marks* marks = scratch_.Find(brick);
    const std::array<float, 3> cube = FromSensor(grid_.CornerOfBrick(brick));
    for (int layer = 0; layer < kBrickSize; ++layer) {
      const uint64_t open = grid_.bits(brick)[layer] & ~(marks == nullptr ? 0 : marks->shielded[layer]);
      for (uint64_t rest = open; rest != 0; rest &= rest - 1) {
        const uint64_t bit = rest & -rest;
        const int at = std::countr_zero(rest);
        const uint32_t id = grid_.IdInBrick(brick, layer, bit);
        scratch_.targets.Add(TargetOf(cube, at & 7, at >> 3, layer, id), IsSparse(masks_[id]));
        scratch_.asked.push_back({brick, layer, bit});
      }
    }
  }

  static bool IsSparse(uint64_t mask) { return mask != 0 && std::popcount(mask) <= kSparse; }

  void TakeAnswers(uint8_t wanted) {
    scratch_.bins.Look(scratch_.targets, clearance_, scratch_.seen);
    for (size_t i = 0; i < scratch_.asked.size(); ++i) {
      const uint8_t seen = scratch_.seen[i] & wanted;
      if (seen == 0) continue;
      const ScanMarks::Asked& asked = scratch_.asked[i];
      ScanMarks::Marks& marks = scratch_.Of(asked.brick);
      if ((seen & RayBins::kSeenThrough) != 0) marks.exposed[asked.layer] |= asked.bit;
      if ((seen & RayBins::kConfirmed) != 0) marks.confirmed[asked.layer] |= asked.bit;
      if ((seen & RayBins::kClear) != 0) marks.clear[asked.layer] |= asked.bit;
    }
    scratch_.asked.clear();
    scratch_.targets.Clear();
  }

  const VoxelGrid& grid_;
  const std::vector<uint64_t>& masks_;
  const std::vector<BoxCode>& boxes_;  // of the masks
  const ExposureParameters& parameters_;
  const Eigen::Vector3d from_;  // the sensor, in voxel edges
  const float end_;             // the share of a ray that exposes
  const RayBins::Clearance clearance_;
  ScanMarks& scratch_;
};

void AddScan(const VoxelGrid& grid, const ScanMarks& scratch, VoxelCounts& counts, uint32_t now) {
  for (const ScanMarks::Marks& marks : scratch.all()) {
    for (int layer = 0; layer < kBrickSize; ++layer) {
      for (uint64_t rest = marks.hit[layer]; rest != 0; rest &= rest - 1) {
        const uint32_t id = grid.IdInBrick(marks.brick, layer, rest & -rest);
        if (counts.hits[id] == 0) {
          counts.early[id] = counts.exposures[id];
          counts.confirmed_early[id] = counts.confirmed[id];
          counts.first_hit[id] = now;
        } else {
          counts.returns[id] += counts.late[id] > 0;
        }
        ++counts.hits[id];
        counts.last_hit[id] = now;
        counts.late[id] = 0;
        counts.confirmed_late[id] = 0;
      }
      for (uint64_t rest = marks.exposed[layer]; rest != 0; rest &= rest - 1) {
        const uint32_t id = grid.IdInBrick(marks.brick, layer, rest & -rest);
        if (counts.hits[id] == 0) counts.free_until[id] = now;
        if (counts.late[id] == 0) counts.free_from[id] = now;
        ++counts.exposures[id];
        ++counts.late[id];
      }
      for (uint64_t rest = marks.confirmed[layer]; rest != 0; rest &= rest - 1) {
        const uint32_t id = grid.IdInBrick(marks.brick, layer, rest & -rest);
        ++counts.confirmed[id];
        ++counts.confirmed_late[id];
      }
      for (uint64_t rest = marks.clear[layer]; rest != 0; rest &= rest - 1) {
        ++counts.clear[grid.IdInBrick(marks.brick, layer, rest & -rest)];
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
  std::vector<double> times(scans.count);
  const auto collect = [&](size_t index, const Scan& scan) -> absl::Status {
    times[index] = scan.time;
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
  voxels.order.resize(scans.count);
  std::iota(voxels.order.begin(), voxels.order.end(), 0U);
  // All the same: a sensor without a clock. A drive cannot be told from its reverse then, nor from any other order.
  voxels.ordered = std::ranges::adjacent_find(times, std::not_equal_to()) != times.end();
  std::ranges::stable_sort(voxels.order, {}, [&](uint32_t index) { return times[index]; });
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
  const size_t size = grid.size();
  VoxelCounts counts{.ordered = voxels.ordered};
  for (std::vector<uint32_t>* column :
       {&counts.hits, &counts.exposures, &counts.confirmed, &counts.early, &counts.late, &counts.first_hit,
        &counts.last_hit, &counts.free_until, &counts.free_from, &counts.confirmed_early, &counts.confirmed_late,
        &counts.clear, &counts.returns}) {
    column->resize(size);
  }
  std::vector<BoxCode> boxes(size);
  for (size_t id = 0; id < size; ++id) {
    // A watched voxel without points has no sub-voxels to look through: any ray exposes it.
    boxes[id] = CodeOf(parameters.sub_voxels && voxels.masks[id] != 0 ? voxels.masks[id] : kFullMask);
  }
  std::vector<ScanMarks> scratches(ScanSlots(), ScanMarks(grid.brick_count()));
  const auto count = [&](size_t index, const Scan& scan, size_t slot) -> absl::Status {
    ScanMarks& scratch = scratches[slot];
    if (auto status = VoxelsOfScan(scan, poses[index], voxel_size, scratch.voxels, scratch.positions); !status.ok())
      return status;
    const auto sensor = VoxelIndexOf(poses[index].translation(), voxel_size);
    if (!sensor.ok()) return {sensor.status().code(), absl::StrCat("its sensor position: ", sensor.status().message())};
    ScanCount scan_count(poses[index].translation() / voxel_size, voxels, boxes, voxel_size, parameters, scratch);
    scan_count.MarkHits();
    if (parameters.engine == ExposureEngine::kRayWalk) {
      scan_count.WalkRays(*sensor);
      if (parameters.clear_around > 0) scan_count.AskVoxels(RayBins::kConfirmed | RayBins::kClear);
    } else {
      scan_count.AskVoxels(RayBins::kSeenThrough | RayBins::kConfirmed | RayBins::kClear);
    }
    return absl::OkStatus();
  };
  uint32_t now = 0;
  const auto add = [&](size_t, size_t slot) {
    AddScan(grid, scratches[slot], counts, now++);
    scratches[slot].Clear();
  };
  if (auto status = ForEachScanInOrder(scans, voxels.order, progress, count, add); !status.ok()) return status;
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
