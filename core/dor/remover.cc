#include "core/dor/remover.h"

#include <algorithm>
#include <utility>

#include "core/dor/exposure.h"
#include "core/dor/scan_loop.h"
#include "core/dor/verdict.h"
#include "core/voxels/voxel_grid.h"

namespace mapkeep {
namespace {

// Where the passes over the scans end, as shares of the whole: collecting voxels, counting.
constexpr double kCollected = 0.2;
constexpr double kCounted = 0.9;

// A submap Z of eq. 3, judged.
struct Window {
  VoxelGrid grid;
  Verdict verdict;
};

std::vector<PointLabel> LabelPoints(const Window& window, const Scan& scan, const Pose& pose,
                                    const DorParameters& parameters, LabelCounts& counts) {
  std::vector<PointLabel> labels(scan.points.size(), PointLabel::kStatic);
  std::vector<VoxelIndex> voxels;
  std::vector<Eigen::Vector3d> positions;
  if (!VoxelsOfScan(scan, pose, parameters.voxel_size, voxels, positions).ok()) return labels;
  counts.points += labels.size();
  int32_t brick = kNoBrick;
  VoxelIndex brick_at;
  for (size_t i = 0; i < labels.size(); ++i) {
    const VoxelIndex in{voxels[i].x >> kBrickBits, voxels[i].y >> kBrickBits, voxels[i].z >> kBrickBits};
    if (i == 0 || in != brick_at) {
      brick = window.grid.FindBrick(in.x, in.y, in.z);
      brick_at = in;
    }
    const uint32_t id = brick == kNoBrick ? kNoVoxel : window.grid.FindInBrick(brick, voxels[i]);
    if (id == kNoVoxel) continue;  // not a scan of the session
    const double height = positions[i].z() * parameters.voxel_size;
    labels[i] = LabelOf(window.verdict, id, voxels[i], height, i, parameters.seed);
    counts.removed += labels[i] == PointLabel::kDynamic;
    counts.restored += window.verdict.voxels[id] == VoxelVerdict::kIsolated && labels[i] == PointLabel::kStatic;
  }
  return labels;
}

// The submap of scan `centre`: the session's scans at most k before or after it.
absl::StatusOr<Window> JudgeWindow(const ScanSource& scans, std::span<const Pose> poses, size_t centre,
                                   const DorParameters& parameters) {
  const auto k = static_cast<size_t>(parameters.window_radius);
  const size_t first = centre - std::min(centre, k);
  const size_t count = std::min(scans.count, centre + k + 1) - first;
  const ScanSource window_scans{count, [&](size_t index) { return scans.read(first + index); }};
  const std::span<const Pose> window_poses = poses.subspan(first, count);
  auto voxels = CollectVoxels(window_scans, window_poses, parameters.voxel_size, {}, {{}});
  if (!voxels.ok()) return voxels.status();
  const auto counts =
      CountVoxels(window_scans, window_poses, parameters.voxel_size, *voxels, parameters.exposure, {{}});
  if (!counts.ok()) return counts.status();
  Verdict verdict = Judge(*voxels, *counts, window_poses, parameters);
  return Window{std::move(voxels->grid), std::move(verdict)};
}

}  // namespace

struct Removal::State {
  std::vector<Pose> poses;
  DorParameters parameters;
  Evidence evidence;
  RemovalReport report;
  std::vector<Window> windows;  // one for the whole session, or one a scan

  const Window& WindowOf(size_t scan) const { return windows[parameters.window_radius == 0 ? 0 : scan]; }
};

std::vector<PointLabel> Removal::Label(size_t index, const Scan& scan, LabelCounts* counts) const {
  LabelCounts unused;
  return LabelPoints(state_->WindowOf(index), scan, state_->poses[index], state_->parameters,
                     counts == nullptr ? unused : *counts);
}

const Evidence& Removal::evidence() const { return state_->evidence; }

const RemovalReport& Removal::report() const { return state_->report; }

absl::StatusOr<Removal> RemoveDynamicObjects(const ScanSource& scans, std::span<const Pose> poses,
                                             std::span<const VoxelKey> watched, const DorParameters& parameters,
                                             const Progress& progress) {
  if (auto status = CheckParameters(parameters); !status.ok()) return status;
  if (auto status = CheckSession(scans, poses); !status.ok()) return status;
  const double voxel_size = parameters.voxel_size;
  auto voxels = CollectVoxels(scans, poses, voxel_size, watched, {progress, 0, kCollected});
  if (!voxels.ok()) return voxels.status();
  const auto counts =
      CountVoxels(scans, poses, voxel_size, *voxels, parameters.exposure, {progress, kCollected, kCounted});
  if (!counts.ok()) return counts.status();

  auto state = std::make_shared<Removal::State>();
  state->poses.assign(poses.begin(), poses.end());
  state->parameters = parameters;
  state->evidence = EvidenceOf(voxels->grid, *counts, voxel_size);
  if (parameters.window_radius == 0) {
    Verdict verdict = Judge(*voxels, *counts, poses, parameters);
    state->windows.push_back({std::move(voxels->grid), std::move(verdict)});
  } else {
    for (size_t i = 0; i < scans.count; ++i) {
      auto window = JudgeWindow(scans, poses, i, parameters);
      if (!window.ok()) return window.status();
      state->windows.push_back(*std::move(window));
    }
  }

  RemovalReport& report = state->report;
  for (const uint32_t hits : state->evidence.hits) report.voxels += hits > 0;
  for (const Window& window : state->windows) {
    for (const VoxelVerdict verdict : window.verdict.voxels) {
      report.dynamic_voxels += verdict == VoxelVerdict::kDynamic || verdict == VoxelVerdict::kIsolated;
      report.ground_voxels += verdict == VoxelVerdict::kGround || verdict == VoxelVerdict::kAnkle;
    }
  }
  if (progress && !progress(1)) return absl::CancelledError("stopped");
  return Removal(std::move(state));
}

}  // namespace mapkeep
