#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <vector>

#include "core/dor/exposure.h"
#include "core/dor/sub_voxels.h"
#include "core/dor/verdict.h"
#include "tests/unit/dor/scenes.h"

namespace mapkeep {

// What the scans of a session said about a voxel.
struct Said {
  uint32_t hits = 0, exposures = 0, returns = 0, confirmed = 0;
  uint32_t first_hit = 0, last_hit = 0;  // scans
  uint32_t clear = 0;
};

// Evidence voxel by voxel, as if a session had given it. Voxels are 0.2 m.
struct CountedScene {
  static constexpr size_t kScans = 100;

  SessionVoxels voxels;
  VoxelCounts counts{.ordered = true};

  void AddCube(const VoxelIndex& corner, int edge, const std::function<Said(int at)>& said) {
    for (int i = 0; i < edge * edge * edge; ++i) {
      at_.push_back({corner.x + i % edge, corner.y + i / edge % edge, corner.z + i / (edge * edge)});
      voxels.grid.Insert(at_.back());
      said_.push_back(said(i));
    }
  }

  void Finish() {
    voxels.grid.Finish();
    voxels.masks.assign(voxels.grid.size(), kFullMask);
    voxels.order.resize(kScans);
    for (auto* column : {&counts.hits, &counts.exposures, &counts.confirmed, &counts.early, &counts.late,
                         &counts.first_hit, &counts.last_hit, &counts.free_until, &counts.free_from,
                         &counts.confirmed_early, &counts.confirmed_late, &counts.clear, &counts.returns}) {
      column->resize(voxels.grid.size());
    }
    for (size_t i = 0; i < at_.size(); ++i) {
      const uint32_t id = voxels.grid.Find(at_[i]);
      counts.hits[id] = said_[i].hits;
      counts.exposures[id] = said_[i].exposures;
      counts.returns[id] = said_[i].returns;
      counts.confirmed[id] = said_[i].confirmed;
      counts.clear[id] = said_[i].clear;
      counts.first_hit[id] = said_[i].first_hit;
      counts.last_hit[id] = said_[i].last_hit;
    }
  }

  Verdict Judged(const DorParameters& parameters = {}) const {
    const std::vector<Pose> poses(kScans, At(0, 0, 0));
    return Judge(voxels, counts, poses, parameters);
  }

  // Share of the voxels that are removed.
  double Removed(const DorParameters& parameters = {}) const {
    const Verdict verdict = Judged(parameters);
    const auto removed = std::ranges::count(verdict.voxels, VoxelVerdict::kDynamic);
    return static_cast<double>(removed) / static_cast<double>(verdict.voxels.size());
  }

  bool IsRemoved(const VoxelIndex& at, const DorParameters& parameters = {}) const {
    return Judged(parameters).voxels[voxels.grid.Find(at)] == VoxelVerdict::kDynamic;
  }

 private:
  std::vector<VoxelIndex> at_;
  std::vector<Said> said_;
};

}  // namespace mapkeep
