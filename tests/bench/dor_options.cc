#include "tests/bench/dor_options.h"

namespace mapkeep {

void AddDorOptions(CLI::App& app, DorParameters& p) {
  app.add_flag_callback(
      "--exact", [&p] { p.exposure.engine = ExposureEngine::kRayWalk; }, "the reference engine");
  app.add_option("--k", p.window_radius);
  app.add_option("--eta", p.eta);
  app.add_option("--tau", p.stability_threshold);
  app.add_option("--sub-voxels", p.exposure.sub_voxels);
  app.add_option("--neighbour-hits", p.exposure.neighbour_hits);
  app.add_option("--margin", p.exposure.margin_by_range);
  app.add_option("--ground", p.protect_ground);
  app.add_option("--slope", p.ground_slope);
  app.add_option("--ground-tolerance", p.ground_tolerance);
  app.add_option("--ground-cell", p.ground_cell);
  app.add_option("--ground-step", p.ground_step);
  app.add_option("--cluster", p.cluster);
  app.add_option("--candidate", p.candidate_threshold);
  app.add_option("--eps", p.cluster_radius);
  app.add_option("--nmin", p.cluster_min_neighbours);
  app.add_option("--tau-cluster", p.cluster_threshold);
  app.add_option("--ankle", p.verify_ankles);
  app.add_option("--ankle-tolerance", p.ankle_tolerance);
  app.add_option("--refine-poses", p.refine_poses);
  app.add_option("--confirm", p.confirm);
  app.add_option("--doubt", p.doubt);
  app.add_option("--doubt-hits", p.doubt_hits);
  app.add_option("--doubt-returns", p.doubt_returns);
  app.add_option("--doubt-stability", p.doubt_stability);
  app.add_option("--doubt-voids", p.doubt_voids);
  app.add_option("--departures", p.departures);
  app.add_option("--drive-offs", p.drive_offs);
  app.add_option("--transients", p.transients);
  app.add_option("--transient-reach", p.transient_reach);
  app.add_option("--transient-scans", p.transient_scans);
  app.add_option("--transient-clear", p.transient_clear);
  app.add_option("--surround", p.surround);
  app.add_option("--inherit", p.inherit);
  app.add_option("--decided", p.decided_scans);
  app.add_option("--surrounded-share", p.surrounded_share);
  app.add_option("--surrounded-time", p.surrounded_time);
  app.add_option("--surround-reach", p.surround_reach);
  app.add_option("--restore", p.restore);
}

}  // namespace mapkeep
