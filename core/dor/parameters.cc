#include "core/dor/parameters.h"

#include <absl/strings/str_format.h>

#include <array>

namespace mapkeep {
namespace {

struct Range {
  const char* name;
  double value, low, high;
};

}  // namespace

absl::Status CheckParameters(const DorParameters& p) {
  const std::array ranges = {
      Range{"voxel_size", p.voxel_size, 0.01, 10},
      Range{"window_radius", static_cast<double>(p.window_radius), 0, 1e6},
      Range{"eta", p.eta, 1e-9, 1},
      Range{"stability_threshold", p.stability_threshold, 0, 1},
      Range{"exposure.margin_by_range", p.exposure.margin_by_range, 0, 1},
      Range{"exposure.clear_around", p.exposure.clear_around, 0, 10},
      Range{"exposure.clear_behind", p.exposure.clear_behind, 0, 100},
      Range{"refinement.cell", p.refinement.cell, 0.05, 10},
      Range{"refinement.points", static_cast<double>(p.refinement.points), 1, 1e6},
      Range{"refinement.rounds", static_cast<double>(p.refinement.rounds), 1, 100},
      Range{"refinement.robust_width", p.refinement.robust_width, 0.001, 10},
      Range{"refinement.max_correction", p.refinement.max_correction, 0, 10},
      Range{"refinement.max_rotation", p.refinement.max_rotation, 0, 1},
      Range{"refinement.min_gain", p.refinement.min_gain, 0, 1},
      Range{"ground_slope", p.ground_slope, 0, 1},
      Range{"ground_tolerance", p.ground_tolerance, 0, 10},
      Range{"ground_cell", p.ground_cell, 0.05, 100},
      Range{"ground_step", p.ground_step, 0, 10},
      Range{"candidate_threshold", p.candidate_threshold, 0, 1},
      Range{"cluster_radius", p.cluster_radius, 0.01, 100},
      Range{"cluster_min_neighbours", static_cast<double>(p.cluster_min_neighbours), 1, 1e6},
      Range{"cluster_threshold", p.cluster_threshold, 0, 1},
      Range{"confirmed_scans", static_cast<double>(p.confirmed_scans), 1, 1e6},
      Range{"confirm_reach", p.confirm_reach, 0.05, 100},
      Range{"doubt_hits", p.doubt_hits, 0, 100},
      Range{"doubt_returns", p.doubt_returns, 0, 100},
      Range{"doubt_stability", p.doubt_stability, 0, 100},
      Range{"doubt_voids", p.doubt_voids, 0, 100},
      Range{"vacated_scans", static_cast<double>(p.vacated_scans), 1, 1e6},
      Range{"vacated_neighbours", static_cast<double>(p.vacated_neighbours), 1, 1e6},
      Range{"vacated_confirmed", static_cast<double>(p.vacated_confirmed), 1, 1e6},
      Range{"departure_reach", p.departure_reach, 0, 100},
      Range{"setting_out", static_cast<double>(p.setting_out), 1, 1e6},
      Range{"transient_reach", p.transient_reach, 0, 2},
      Range{"transient_scans", static_cast<double>(p.transient_scans), 1, 1e6},
      Range{"transient_clear", p.transient_clear, 0, 100},
      Range{"decided_scans", static_cast<double>(p.decided_scans), 0, 1e6},
      Range{"surrounded_share", p.surrounded_share, 0, 1},
      Range{"surrounded_time", p.surrounded_time, 0, 1},
      Range{"surround_reach", p.surround_reach, 0, 2},
      Range{"ankle_tolerance", p.ankle_tolerance, 0, 10},
  };
  for (const Range& range : ranges) {
    // Written so that NaN is refused as well.
    if (!(range.value >= range.low && range.value <= range.high)) {
      return absl::InvalidArgumentError(
          absl::StrFormat("dor parameter %s is %g, expected %g to %g", range.name, range.value, range.low, range.high));
    }
  }
  return absl::OkStatus();
}

}  // namespace mapkeep
