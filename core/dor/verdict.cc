#include "core/dor/verdict.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/dor/clusters.h"
#include "core/dor/departures.h"
#include "core/dor/drive_offs.h"
#include "core/dor/ground.h"
#include "core/dor/near_voxels.h"
#include "core/dor/restoration.h"
#include "core/dor/surface.h"
#include "core/dor/surroundings.h"
#include "core/dor/transients.h"
#include "core/voxels/block.h"

namespace mapkeep {
namespace {

constexpr int kMinAnchorSubVoxels = 6;  // occupied sub-voxels that a normal needs

// The statistics of a grid, voxel by voxel.
class Scene {
 public:
  Scene(const SessionVoxels& voxels, const VoxelCounts& counts, const DorParameters& parameters)
      : grid_(voxels.grid), masks_(voxels.masks), counts_(counts), parameters_(parameters), indices_(grid_.size()) {
    for (size_t brick = 0; brick < grid_.brick_count(); ++brick) {
      grid_.ForEachInBrick(static_cast<int32_t>(brick), [&](uint32_t id, const VoxelIndex& v) { indices_[id] = v; });
    }
  }

  size_t size() const { return indices_.size(); }
  const VoxelIndex& index(uint32_t id) const { return indices_[id]; }
  std::span<const VoxelIndex> indices() const { return indices_; }
  bool was_hit(uint32_t id) const { return counts_.hits[id] > 0; }
  bool was_exposed(uint32_t id) const { return counts_.exposures[id] > 0; }
  uint32_t hits(uint32_t id) const { return counts_.hits[id]; }
  uint32_t scans(uint32_t id) const { return counts_.hits[id] + counts_.exposures[id]; }
  double R(uint32_t id) const { return Stability(counts_.hits[id], counts_.exposures[id], parameters_.eta); }

  Eigen::Vector3d Centroid(uint32_t id) const {
    return CornerOf(indices_[id], parameters_.voxel_size) + parameters_.voxel_size * MeanInVoxel(masks_[id]);
  }

  Surface OwnSurface(uint32_t id) const { return SurfaceOf(MomentsOf(masks_[id])); }

  // Over the voxel and its 26 neighbours.
  Moments MomentsAround(uint32_t id) const {
    Moments moments;
    ForEachWithin(1, id, [&](uint32_t other, int dx, int dy, int dz) {
      moments += MomentsOf(masks_[other]).Shifted({int64_t{4} * dx, int64_t{4} * dy, int64_t{4} * dz});
    });
    return moments;
  }

  // Calls visit(id, dx, dy, dz) for the voxels at most `reach` away an axis that the grid has, the voxel itself
  // included.
  template <typename Visit>
  void ForEachWithin(int reach, uint32_t id, const Visit& visit) const {
    grid_.ForEachWithin(reach, indices_[id], visit);
  }

  // Calls work(id) for all voxels, in parallel.
  template <typename Work>
  void ForEach(const Work& work) const {
    tbb::parallel_for(tbb::blocked_range<uint32_t>(0, static_cast<uint32_t>(size()), 1024), [&](const auto& range) {
      for (uint32_t id = range.begin(); id != range.end(); ++id) work(id);
    });
  }

  uint32_t Above(uint32_t id) const {
    const VoxelIndex& at = indices_[id];
    return grid_.Find({at.x, at.y, at.z + 1});
  }

 private:
  const VoxelGrid& grid_;
  const std::vector<uint64_t>& masks_;
  const VoxelCounts& counts_;
  const DorParameters& parameters_;
  std::vector<VoxelIndex> indices_;
};

// Ground anchors by their normals, the local ground height, and the voxels close to it. What is looked through is no
// anchor: the roofs along the way of a car are horizontal too.
void ProtectGround(const Scene& scene, std::span<const Pose> poses, const DorParameters& parameters,
                   std::vector<VoxelVerdict>& verdicts, std::vector<float>& heights) {
  std::vector<char> is_anchor(scene.size());
  scene.ForEach([&](uint32_t id) {
    if (!scene.was_hit(id)) return;
    if (scene.R(id) < parameters.stability_threshold) return;
    const Moments moments = scene.MomentsAround(id);
    is_anchor[id] =
        moments.count >= kMinAnchorSubVoxels && std::abs(SurfaceOf(moments).normal.z()) > parameters.ground_slope;
  });
  std::vector<Eigen::Vector3d> anchors;
  for (uint32_t id = 0; id < scene.size(); ++id) {
    if (is_anchor[id]) anchors.push_back(scene.Centroid(id));
  }
  std::vector<Eigen::Vector3d> sensors;
  for (const Pose& pose : poses) sensors.emplace_back(pose.translation());
  const Ground ground(anchors, sensors, {.cell = parameters.ground_cell, .step = parameters.ground_step});
  scene.ForEach([&](uint32_t id) {
    if (!scene.was_hit(id)) return;
    const Eigen::Vector3d centroid = scene.Centroid(id);
    const auto height = ground.HeightNear(centroid);
    if (!height || std::abs(centroid.z() - *height) >= parameters.ground_tolerance) return;
    verdicts[id] = VoxelVerdict::kGround;
    heights[id] = static_cast<float>(*height);
  });
}

// The voxels that are dynamic for their R alone.
void JudgeVoxels(const Scene& scene, const DorParameters& parameters, std::vector<VoxelVerdict>& verdicts) {
  scene.ForEach([&](uint32_t id) {
    if (verdicts[id] == VoxelVerdict::kStatic && scene.was_hit(id) && scene.R(id) < parameters.stability_threshold) {
      verdicts[id] = VoxelVerdict::kDynamic;
    }
  });
}

// Eq. 5: candidates are judged together with what they hang together with.
void JudgeClusters(const Scene& scene, const DorParameters& parameters, std::vector<VoxelVerdict>& verdicts) {
  std::vector<uint32_t> candidates;
  std::vector<Eigen::Vector3d> centroids;
  for (uint32_t id = 0; id < scene.size(); ++id) {
    if (verdicts[id] == VoxelVerdict::kGround || !scene.was_hit(id)) continue;
    if (scene.R(id) >= parameters.candidate_threshold) continue;
    candidates.push_back(id);
    centroids.push_back(scene.Centroid(id));
  }
  const Clusters clusters = ClusterPoints(centroids, parameters.cluster_radius, parameters.cluster_min_neighbours);
  std::vector<double> sums(clusters.count), sizes(clusters.count);
  for (size_t i = 0; i < candidates.size(); ++i) {
    if (clusters.ids[i] == kNoise) continue;
    sums[clusters.ids[i]] += scene.R(candidates[i]);
    sizes[clusters.ids[i]] += 1;
  }
  for (size_t i = 0; i < candidates.size(); ++i) {
    const int32_t cluster = clusters.ids[i];
    if (cluster == kNoise) continue;  // keeps the verdict on its own R
    if (sums[cluster] / sizes[cluster] < parameters.cluster_threshold) {
      verdicts[candidates[i]] = VoxelVerdict::kDynamic;
    } else if (scene.R(candidates[i]) >= parameters.stability_threshold / 2) {
      verdicts[candidates[i]] = VoxelVerdict::kStatic;  // what is far below the threshold moved, whatever it touches
    }
  }
}

std::vector<uint32_t> DynamicVoxels(const std::vector<VoxelVerdict>& verdicts) {
  std::vector<uint32_t> ids;
  for (uint32_t id = 0; id < verdicts.size(); ++id) {
    if (verdicts[id] == VoxelVerdict::kDynamic) ids.push_back(id);
  }
  return ids;
}

// `edge` in voxel edges.
NearVoxels NearVoxelsOf(const Scene& scene, std::span<const uint32_t> ids, double edge) {
  NearVoxels near(edge);
  for (const uint32_t id : ids) near.Insert(scene.index(id));
  near.Finish();
  return near;
}

// What is dynamic for its R must have moved through a place that was clear: surfaces are looked through at grazing
// angles, but there no confirmed void is near.
void Confirm(const Scene& scene, const VoxelCounts& counts, const DorParameters& parameters,
             std::vector<VoxelVerdict>& verdicts) {
  std::vector<uint32_t> voids = DynamicVoxels(verdicts);
  std::erase_if(voids,
                [&](uint32_t id) { return counts.confirmed[id] < static_cast<uint32_t>(parameters.confirmed_scans); });
  const NearVoxels confirmed = NearVoxelsOf(scene, voids, parameters.confirm_reach / parameters.voxel_size);
  scene.ForEach([&](uint32_t id) {
    if (verdicts[id] != VoxelVerdict::kDynamic || confirmed.AnyNear(scene.index(id))) return;
    verdicts[id] = VoxelVerdict::kStatic;
  });
}

// Whether a voxel's own hits and what is known about its surroundings speak against its having moved, however low its
// R: leaves, and surfaces at grazing angles, are hit and looked through by turns, beside others that are hit more
// often, and hardly any is ever a confirmed void.
bool IsDoubtful(const EvidenceAround& around, uint32_t hits, const DorParameters& parameters) {
  return parameters.doubt_hits * std::log(hits) + parameters.doubt_returns * around.return_share() +
             parameters.doubt_stability * around.stability() - parameters.doubt_voids * around.void_share() >
         1;
}

void Doubt(const Scene& scene, const Surroundings& surroundings, const DorParameters& parameters,
           std::vector<VoxelVerdict>& verdicts) {
  scene.ForEach([&](uint32_t id) {
    if (verdicts[id] != VoxelVerdict::kDynamic) return;
    if (!IsDoubtful(surroundings.Around(scene.index(id)), scene.hits(id), parameters)) return;
    verdicts[id] = VoxelVerdict::kStatic;
  });
}

// Whether a voxel lies on a plane along which a sensor looks at it: there its rays may slip past.
bool IsGrazed(const Scene& scene, uint32_t id, const Eigen::Vector3d& sensor) {
  constexpr double kMaxSine = 0.08;  // of the angle between ray and surface
  constexpr double kMinPlanarity = 0.5;
  const Surface surface = SurfaceOf(scene.MomentsAround(id));
  const Eigen::Vector3d ray = scene.Centroid(id) - sensor;
  return surface.planarity() >= kMinPlanarity && std::abs(ray.dot(surface.normal)) < kMaxSine * ray.norm();
}

// What left or came during the session.
void JudgeDepartures(const Scene& scene, const SessionVoxels& voxels, const VoxelCounts& counts,
                     std::span<const Pose> poses, const DorParameters& parameters,
                     std::vector<VoxelVerdict>& verdicts) {
  if (!counts.ordered) return;
  std::vector<char> candidates(verdicts.size()), is_dynamic(verdicts.size());
  for (uint32_t id = 0; id < verdicts.size(); ++id) {
    candidates[id] = verdicts[id] != VoxelVerdict::kGround && scene.was_hit(id);
    is_dynamic[id] = verdicts[id] == VoxelVerdict::kDynamic;
  }
  // A surface of a given size has more voxels the smaller they are.
  const double more = std::clamp(std::pow(0.2 / parameters.voxel_size, 2), 1.0, 4.0);
  const std::vector<char> departed = FindDepartures(
      voxels.grid, counts,
      {.indices = scene.indices(),
       .candidates = candidates,
       .is_dynamic = is_dynamic,
       .is_grazed = [&](uint32_t id,
                        uint32_t scan) { return IsGrazed(scene, id, poses[voxels.order[scan]].translation()); }},
      {.voxel_size = parameters.voxel_size,
       .vacated_scans = parameters.vacated_scans,
       .vacated_neighbours = static_cast<int>(std::lround(more * parameters.vacated_neighbours)),
       .confirmed_neighbours = static_cast<int>(std::lround(more * parameters.vacated_confirmed)),
       .confirm_reach = parameters.confirm_reach,
       .reach = parameters.departure_reach});
  for (uint32_t id = 0; id < verdicts.size(); ++id) {
    if (departed[id]) verdicts[id] = VoxelVerdict::kDynamic;
  }
}

// What was somewhere for a short while, where it was clear besides. Gives which voxels that are.
std::vector<char> JudgeTransients(const Scene& scene, const VoxelGrid& grid, const VoxelCounts& counts,
                                  const DorParameters& parameters, std::vector<VoxelVerdict>& verdicts) {
  std::vector<char> is_part(verdicts.size()), candidates(verdicts.size());
  for (uint32_t id = 0; id < verdicts.size(); ++id) {
    is_part[id] = verdicts[id] != VoxelVerdict::kGround && scene.was_hit(id);
    candidates[id] = verdicts[id] == VoxelVerdict::kStatic && scene.was_hit(id);
  }
  std::vector<char> found = FindTransients(grid, scene.indices(), counts, is_part, candidates,
                                           {.voxel_size = parameters.voxel_size,
                                            .reach = parameters.transient_reach,
                                            .most_scans = parameters.transient_scans,
                                            .clear_share = parameters.transient_clear});
  for (uint32_t id = 0; id < verdicts.size(); ++id) {
    if (found[id]) verdicts[id] = VoxelVerdict::kDynamic;
  }
  return found;
}

// A voxel that few scans saw says little: the far end of a car's way was there once and never seen through. If what was
// decided around it is mostly dynamic, so is it.
void Inherit(const Scene& scene, const DorParameters& parameters, std::vector<VoxelVerdict>& verdicts) {
  constexpr int kReach = 2;  // voxels
  const NearVoxels dynamic_ones = NearVoxelsOf(scene, DynamicVoxels(verdicts), kReach);
  std::vector<char> inherits(scene.size());
  scene.ForEach([&](uint32_t id) {
    if (verdicts[id] != VoxelVerdict::kStatic || !scene.was_hit(id)) return;
    if (scene.scans(id) >= static_cast<uint32_t>(parameters.decided_scans)) return;
    if (!dynamic_ones.AnyNear(scene.index(id))) return;
    int dynamic = 0, decided = 0;
    scene.ForEachWithin(kReach, id, [&](uint32_t other, int, int, int) {
      dynamic += verdicts[other] == VoxelVerdict::kDynamic;
      decided += verdicts[other] == VoxelVerdict::kStatic && scene.was_hit(other) &&
                 scene.scans(other) >= static_cast<uint32_t>(parameters.decided_scans);
    });
    inherits[id] = dynamic >= 2 && dynamic > 2 * decided;
  });
  for (uint32_t id = 0; id < scene.size(); ++id) {
    if (inherits[id]) verdicts[id] = VoxelVerdict::kDynamic;
  }
}

// What lies among dynamic voxels and was looked through at all, or was hit for a part of the time only in which
// anything was hit around it, belongs to the same thing: a person who hardly moves leaves voxels in the middle that
// were hit most of the time, and are never looked through while he stands behind them. Without surroundings nothing is
// doubted.
void JudgeSurrounded(const Scene& scene, const SessionVoxels& voxels, const VoxelCounts& counts,
                     const Surroundings* surroundings, const DorParameters& parameters,
                     std::vector<VoxelVerdict>& verdicts) {
  constexpr int kRounds = 3;
  constexpr int kReach = 2;               // voxels
  constexpr double kMinRadius = 2.3;      // voxel edges: of the ball in which the times are compared
  constexpr int kMaxSquaredDistance = 5;  // voxel edges: of those whose share decides where a ray looked through
  constexpr int kMinAround = 3, kMinInBall = 4;
  const double radius = std::max(kMinRadius, parameters.surround_reach / parameters.voxel_size);
  const auto is_dynamic = [&](uint32_t id) { return verdicts[id] == VoxelVerdict::kDynamic; };
  const auto counts_around = [&](uint32_t id) { return verdicts[id] != VoxelVerdict::kGround && scene.was_hit(id); };
  // Whether it was hit for a part of the time of its surroundings, most of which are dynamic.
  const auto is_part = [&](uint32_t id) {
    uint32_t first = counts.first_hit[id], last = counts.last_hit[id];
    const auto part = static_cast<double>(last - first + 1);
    if (part >= parameters.surrounded_time * static_cast<double>(voxels.order.size())) return false;
    int all = 0, dynamic = 0;
    voxels.grid.ForEachInBall(radius, scene.index(id), [&](uint32_t other, int, int, int) {
      if (!counts_around(other)) return;
      ++all;
      dynamic += is_dynamic(other);
      first = std::min(first, counts.first_hit[other]);
      last = std::max(last, counts.last_hit[other]);
    });
    return all >= kMinInBall && dynamic >= parameters.surrounded_share * all &&
           part < parameters.surrounded_time * static_cast<double>(last - first + 1);
  };
  const auto is_surrounded = [&](uint32_t id) {
    int around = 0, dynamic = 0;
    scene.ForEachWithin(kReach, id, [&](uint32_t other, int dx, int dy, int dz) {
      if (other == id || dx * dx + dy * dy + dz * dz > kMaxSquaredDistance || !counts_around(other)) return;
      ++around;
      dynamic += is_dynamic(other);
    });
    if (scene.was_exposed(id) && around >= kMinAround && dynamic > parameters.surrounded_share * around) return true;
    return counts.ordered && dynamic > 0 && is_part(id);
  };
  std::vector<char> surrounded(scene.size());
  // Those around which nothing became dynamic since they were looked at stay what they are.
  std::vector<uint32_t> changed = DynamicVoxels(verdicts);
  for (int round = 0; round < kRounds && !changed.empty(); ++round) {
    const NearVoxels near_change = NearVoxelsOf(scene, changed, kReach);
    scene.ForEach([&](uint32_t id) {
      surrounded[id] =
          verdicts[id] == VoxelVerdict::kStatic && scene.was_hit(id) && near_change.AnyNear(scene.index(id)) &&
          is_surrounded(id) &&
          !(surroundings != nullptr && IsDoubtful(surroundings->Around(scene.index(id)), scene.hits(id), parameters));
    });
    changed.clear();
    for (uint32_t id = 0; id < scene.size(); ++id) {
      if (!surrounded[id]) continue;
      verdicts[id] = VoxelVerdict::kDynamic;
      changed.push_back(id);
    }
  }
}

// What drove off where nobody looked again.
void JudgeDriveOffs(const Scene& scene, const SessionVoxels& voxels, const VoxelCounts& counts,
                    const DorParameters& parameters, std::vector<VoxelVerdict>& verdicts) {
  std::vector<char> is_static(verdicts.size()), is_dynamic(verdicts.size());
  for (uint32_t id = 0; id < verdicts.size(); ++id) {
    is_static[id] = verdicts[id] == VoxelVerdict::kStatic && scene.was_hit(id);
    is_dynamic[id] = verdicts[id] == VoxelVerdict::kDynamic;
  }
  const std::vector<char> left =
      FindDriveOffs(voxels.grid, scene.indices(), counts, is_static, is_dynamic,
                    {.voxel_size = parameters.voxel_size, .setting_out = parameters.setting_out});
  for (uint32_t id = 0; id < verdicts.size(); ++id) {
    if (left[id]) verdicts[id] = VoxelVerdict::kDynamic;
  }
}

// Whether what stands on a ground voxel is dynamic. With small voxels the ground is several of them high.
bool IsUnderDynamic(const Scene& scene, const std::vector<VoxelVerdict>& verdicts, uint32_t id) {
  uint32_t above = scene.Above(id);
  while (above != kNoVoxel && verdicts[above] == VoxelVerdict::kGround) above = scene.Above(above);
  return above != kNoVoxel && verdicts[above] == VoxelVerdict::kDynamic;
}

// Feet and wheels: under something dynamic, or where the ground voxel itself was looked through, points go by their
// height above the ground.
void VerifyAnkles(const Scene& scene, const DorParameters& parameters, const std::vector<float>& heights,
                  Verdict& verdict) {
  for (uint32_t id = 0; id < scene.size(); ++id) {
    if (verdict.voxels[id] != VoxelVerdict::kGround) continue;
    if (!IsUnderDynamic(scene, verdict.voxels, id) && scene.R(id) >= parameters.stability_threshold) continue;
    // A voxel that holds nothing but the foot has its mean height up in the foot.
    const double ground = std::min<double>(heights[id], scene.Centroid(id).z());
    verdict.ankle_heights[id] = ground + parameters.ankle_tolerance;
  }
  for (const auto& [id, height] : verdict.ankle_heights) verdict.voxels[id] = VoxelVerdict::kAnkle;
}

// Eq. 6. What was `transient` has other evidence than its R.
void FindIsolated(const Scene& scene, std::span<const char> transient, Verdict& verdict) {
  for (uint32_t id = 0; id < scene.size(); ++id) {
    if (verdict.voxels[id] != VoxelVerdict::kDynamic || transient[id]) continue;
    int dynamic = 0;
    scene.ForEachWithin(
        1, id, [&](uint32_t other, int, int, int) { dynamic += verdict.voxels[other] == VoxelVerdict::kDynamic; });
    if (dynamic > 1) continue;
    verdict.restore_probabilities[id] = RestorationProbability(scene.R(id), scene.OwnSurface(id).planarity());
  }
  for (const auto& [id, probability] : verdict.restore_probabilities) verdict.voxels[id] = VoxelVerdict::kIsolated;
}

}  // namespace

PointLabel LabelOf(const Verdict& verdict, uint32_t id, const VoxelIndex& voxel, double height, size_t point,
                   uint64_t seed) {
  switch (verdict.voxels[id]) {
    case VoxelVerdict::kStatic:
      break;
    case VoxelVerdict::kGround:
      return PointLabel::kGround;
    case VoxelVerdict::kDynamic:
      return PointLabel::kDynamic;
    case VoxelVerdict::kAnkle:
      return height > verdict.ankle_heights.at(id) ? PointLabel::kDynamic : PointLabel::kGround;
    case VoxelVerdict::kIsolated: {
      const double probability = verdict.restore_probabilities.at(id);
      return IsRestored(probability, VoxelKeyOf(voxel), point, seed) ? PointLabel::kStatic : PointLabel::kDynamic;
    }
  }
  return PointLabel::kStatic;
}

Verdict Judge(const SessionVoxels& voxels, const VoxelCounts& counts, std::span<const Pose> poses,
              const DorParameters& parameters) {
  const Scene scene(voxels, counts, parameters);
  Verdict verdict{.voxels = std::vector<VoxelVerdict>(voxels.grid.size(), VoxelVerdict::kStatic)};
  std::vector<float> heights(voxels.grid.size());  // of the ground at ground voxels, metres
  if (parameters.protect_ground) ProtectGround(scene, poses, parameters, verdict.voxels, heights);
  JudgeVoxels(scene, parameters, verdict.voxels);
  if (parameters.cluster) JudgeClusters(scene, parameters, verdict.voxels);
  if (parameters.confirm && parameters.exposure.clear_around > 0) Confirm(scene, counts, parameters, verdict.voxels);
  std::optional<Surroundings> surroundings;
  if (parameters.doubt && parameters.exposure.clear_around > 0) {
    surroundings.emplace(voxels.grid, counts, parameters.voxel_size, parameters.candidate_threshold,
                         [&](uint32_t id) { return scene.was_hit(id) && verdict.voxels[id] != VoxelVerdict::kGround; });
    Doubt(scene, *surroundings, parameters, verdict.voxels);
  }
  if (parameters.departures) JudgeDepartures(scene, voxels, counts, poses, parameters, verdict.voxels);
  std::vector<char> transient(scene.size());
  if (parameters.transients && parameters.exposure.clear_around > 0) {
    transient = JudgeTransients(scene, voxels.grid, counts, parameters, verdict.voxels);
  }
  if (parameters.inherit) Inherit(scene, parameters, verdict.voxels);
  if (parameters.surround) {
    JudgeSurrounded(scene, voxels, counts, surroundings ? &*surroundings : nullptr, parameters, verdict.voxels);
  }
  if (parameters.drive_offs) JudgeDriveOffs(scene, voxels, counts, parameters, verdict.voxels);
  if (parameters.verify_ankles) VerifyAnkles(scene, parameters, heights, verdict);
  if (parameters.restore) FindIsolated(scene, transient, verdict);
  return verdict;
}

}  // namespace mapkeep
