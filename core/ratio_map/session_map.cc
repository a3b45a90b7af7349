#include "core/ratio_map/session_map.h"

#include <absl/strings/str_format.h>
#include <tbb/parallel_pipeline.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <cmath>

#include "core/ratio_map/normals.h"
#include "core/ratio_map/scan_voxels.h"

namespace mapkeep {
namespace {

// Sums over the scans that hit a voxel: every scan weighs the same, as it does in H. 2^19 scans fit.
struct Sums {
  uint32_t hits = 0;
  uint32_t ground = 0;
  std::array<uint32_t, 3> mean{};
  uint32_t intensity = 0;
  std::array<int32_t, 3> towards_sensor{};
  uint64_t mask = 0;

  void Add(const ScanVoxel& voxel) {
    ++hits;
    ground += voxel.ground ? 1 : 0;
    for (int axis = 0; axis < 3; ++axis) {
      mean[axis] += voxel.mean[axis];
      towards_sensor[axis] += voxel.towards_sensor[axis];
    }
    intensity += voxel.intensity;
    mask |= voxel.mask;
  }
};
constexpr size_t kMaxScans = size_t{1} << 19;

// One scan's contribution on its way from the parallel stage to the ordered one.
struct Contribution {
  size_t scan = 0;
  absl::Status status;
  std::vector<ScanVoxel> voxels;
  std::vector<uint32_t> slots;  // of the voxels, in the evidence
};

// The first key of [at, end) that is not below `key`, which is likely near: looked for in steps that double.
using Keys = std::span<const VoxelKey>;
Keys::iterator NotBelow(Keys::iterator at, Keys::iterator end, VoxelKey key) {
  ptrdiff_t step = 1;
  auto low = at;
  while (end - low > step && low[step] < key) {
    low += step;
    step *= 2;
  }
  return std::lower_bound(low, end - low > step ? low + step + 1 : end, key);
}

// Where each voxel of a scan lies in the evidence; both are sorted, so one walk finds all.
absl::StatusOr<std::vector<uint32_t>> SlotsOf(std::span<const ScanVoxel> voxels, std::span<const VoxelKey> keys) {
  std::vector<uint32_t> slots;
  slots.reserve(voxels.size());
  auto at = keys.begin();
  for (const ScanVoxel& voxel : voxels) {
    at = NotBelow(at, keys.end(), voxel.key);
    if (at == keys.end() || *at != voxel.key) {
      const VoxelIndex index = VoxelIndexOf(voxel.key);
      return absl::InvalidArgumentError(absl::StrFormat(
          "a kept point lies in voxel (%d, %d, %d), of which the evidence knows nothing: it was counted on other scans "
          "or poses",
          index.x, index.y, index.z));
    }
    slots.push_back(static_cast<uint32_t>(at - keys.begin()));
  }
  return slots;
}

Contribution ContributionOf(size_t index, const ScanSource& scans, const Pose& pose, const Labeller& label,
                            const Evidence& evidence) {
  Contribution result{.scan = index};
  const auto fail = [&](const absl::Status& status) {
    result.status = absl::Status(status.code(), absl::StrFormat("scan %d: %s", index, status.message()));
    return result;
  };
  const auto scan = scans.read(index);
  if (!scan.ok()) {
    result.status = scan.status();
    return result;
  }
  const std::vector<PointLabel> labels = label(index, *scan);
  if (labels.size() != scan->points.size()) {
    return fail(
        absl::InvalidArgumentError(absl::StrFormat("%d labels for %d points", labels.size(), scan->points.size())));
  }
  auto voxels = VoxelsOfScan(*scan, pose, labels, evidence.voxel_size);
  if (!voxels.ok()) return fail(voxels.status());
  auto slots = SlotsOf(*voxels, evidence.keys);
  if (!slots.ok()) return fail(slots.status());
  result.voxels = *std::move(voxels);
  result.slots = *std::move(slots);
  return result;
}

// Scans are read, labelled and put into voxels in parallel, a bounded number at a time, and added up in their order.
absl::StatusOr<std::vector<Sums>> SumScans(const ScanSource& scans, std::span<const Pose> poses, const Labeller& label,
                                           const Evidence& evidence, const Progress& progress) {
  std::vector<Sums> sums(evidence.keys.size());
  absl::Status status;
  std::atomic<bool> stop = false;
  size_t next = 0;
  const auto read = [&](tbb::flow_control& control) -> size_t {
    if (next == scans.count || stop) {
      control.stop();
      return 0;
    }
    return next++;
  };
  const auto digest = [&](size_t index) { return ContributionOf(index, scans, poses[index], label, evidence); };
  const auto add = [&](const Contribution& contribution) {
    if (!status.ok()) return;
    status = contribution.status;
    for (size_t i = 0; i < contribution.voxels.size(); ++i) sums[contribution.slots[i]].Add(contribution.voxels[i]);
    const double done = static_cast<double>(contribution.scan + 1) / static_cast<double>(scans.count);
    if (status.ok() && progress && !progress(done)) {
      status = absl::CancelledError("stopped while building the session map");
    }
    if (!status.ok()) stop = true;
  };
  const auto in_flight = 2 * static_cast<size_t>(tbb::this_task_arena::max_concurrency());
  tbb::parallel_pipeline(in_flight, tbb::make_filter<void, size_t>(tbb::filter_mode::serial_in_order, read) &
                                        tbb::make_filter<size_t, Contribution>(tbb::filter_mode::parallel, digest) &
                                        tbb::make_filter<Contribution, void>(tbb::filter_mode::serial_in_order, add));
  if (!status.ok()) return status;
  return sums;
}

// The nearest-rank percentile; 100 is the maximum.
double PercentileOf(std::vector<uint32_t> values, double percentile) {
  if (values.empty()) return 0;
  const auto count = static_cast<double>(values.size());
  const auto rank = static_cast<size_t>(std::clamp(std::ceil(percentile / 100 * count), 1.0, count)) - 1;
  std::ranges::nth_element(values, values.begin() + static_cast<ptrdiff_t>(rank));
  return values[rank];
}

// kFractionScale steps to 256, after the mean over the scans.
uint8_t MeanByte(uint32_t sum, uint32_t scans) {
  return static_cast<uint8_t>(uint64_t{sum} / scans / (kFractionScale / 256));
}

SessionVoxel VoxelOf(VoxelKey key, const Sums& sums, uint32_t hits, uint32_t exposures) {
  SessionVoxel voxel{.key = key, .hits = sums.hits, .exposures = exposures, .was_removed = hits > 0 && sums.hits == 0};
  if (sums.hits == 0) return voxel;
  voxel.ground = 2 * uint64_t{sums.ground} > sums.hits;
  for (int axis = 0; axis < 3; ++axis) voxel.mean[axis] = MeanByte(sums.mean[axis], sums.hits);
  voxel.intensity = MeanByte(sums.intensity, sums.hits);
  voxel.mask = sums.mask;
  return voxel;
}

Surfel SurfelOf(VoxelKey key, const Sums& sums) {
  const float edge = static_cast<float>(kFractionScale) * static_cast<float>(sums.hits);
  return {.key = key,
          .mean = Eigen::Vector3f(static_cast<float>(sums.mean[0]), static_cast<float>(sums.mean[1]),
                                  static_cast<float>(sums.mean[2])) /
                  edge,
          .mask = sums.mask,
          .towards_sensor =
              Eigen::Vector3f(static_cast<float>(sums.towards_sensor[0]), static_cast<float>(sums.towards_sensor[1]),
                              static_cast<float>(sums.towards_sensor[2]))};
}

void SetNormals(std::vector<SessionVoxel>& voxels, std::span<const Surfel> surfels, double radius_voxels) {
  const auto normals = EstimateNormals(surfels, radius_voxels);
  size_t next = 0;
  for (SessionVoxel& voxel : voxels) {
    if (voxel.hits > 0) voxel.normal = normals[next++];
  }
}

absl::Status CheckInput(const ScanSource& scans, std::span<const Pose> poses, const Evidence& evidence,
                        const SessionMapParameters& parameters) {
  if (scans.count != poses.size()) {
    return absl::InvalidArgumentError(absl::StrFormat("%d scans but %d poses", scans.count, poses.size()));
  }
  if (scans.count > kMaxScans) {
    return absl::InvalidArgumentError(absl::StrFormat("%d scans in one session, at most %d", scans.count, kMaxScans));
  }
  if (!(evidence.voxel_size > 0)) {
    return absl::InvalidArgumentError(absl::StrFormat("voxel size %g m, expected more than 0", evidence.voxel_size));
  }
  if (evidence.keys.size() != evidence.hits.size() || evidence.keys.size() != evidence.exposures.size()) {
    return absl::InvalidArgumentError("the columns of the evidence differ in length");
  }
  if (!(parameters.n_max_percentile >= 0 && parameters.n_max_percentile <= 100)) {
    return absl::InvalidArgumentError(
        absl::StrFormat("n_max_percentile is %g, expected 0 to 100", parameters.n_max_percentile));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<SessionMap> BuildSessionMap(const ScanSource& scans, std::span<const Pose> poses, const Labeller& label,
                                           const Evidence& evidence, uint32_t start_minutes,
                                           const SessionMapParameters& parameters, const Progress& progress) {
  if (const absl::Status status = CheckInput(scans, poses, evidence, parameters); !status.ok()) return status;
  const auto sums = SumScans(scans, poses, label, evidence, progress);
  if (!sums.ok()) return sums.status();

  SessionMap map{.voxel_size = evidence.voxel_size, .start_minutes = start_minutes};
  std::vector<Surfel> surfels;
  std::vector<uint32_t> evidence_of_hit;
  for (size_t i = 0; i < sums->size(); ++i) {
    const Sums& sum = (*sums)[i];
    if (sum.hits == 0 && evidence.exposures[i] == 0) continue;
    map.voxels.push_back(VoxelOf(evidence.keys[i], sum, evidence.hits[i], evidence.exposures[i]));
    if (sum.hits == 0) continue;
    surfels.push_back(SurfelOf(evidence.keys[i], sum));
    evidence_of_hit.push_back(sum.hits + evidence.exposures[i]);
  }
  SetNormals(map.voxels, surfels, parameters.normal_radius_voxels);
  map.n_max = PercentileOf(std::move(evidence_of_hit), parameters.n_max_percentile);
  return map;
}

}  // namespace mapkeep
