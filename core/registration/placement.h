#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <span>

#include "core/geometry/pose.h"
#include "core/registration/fitness.h"
#include "core/registration/gicp.h"
#include "core/registration/parameters.h"
#include "core/registration/point_tree.h"
#include "core/registration/structure.h"
#include "core/registration/target_map.h"
#include "core/registration/window_cloud.h"

namespace mapkeep {

/// Where refinement put a window, and how well it lies there.
struct Placement {
  Pose pose = Pose::Identity();  ///< T_map_window
  Fit fit;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< of the window's points, map frame
  Eigen::Matrix<double, 6, 6> information =
      Eigen::Matrix<double, 6, 6>::Zero();  ///< GicpResult::information where refinement ended
  double correction = 0;                    ///< metres between the guess and the pose, at the window's first sensor
  double rotation = 0;                      ///< radians between them
};

/// Where a scan lies by its own points.
struct ScanPlacement {
  Pose pose = Pose::Identity();  ///< T_map_sensor
  /// What its surfaces fix of the motion (translation, rotation about the sensor): GicpResult::information there.
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();
  size_t pairs = 0;  ///< points that met the map; 0: it says nothing
};

/// A part of the map with its search tree, on which windows are placed.
class Placer {
 public:
  Placer(RegistrationTarget target, const AlignParameters& parameters);
  Placer(const Placer&) = delete;
  Placer& operator=(const Placer&) = delete;

  bool empty() const { return target_.points.empty(); }

  /// Coarse, then fine GICP from the guess (T_map_window), and the fit where that ends.
  Placement Place(const WindowCloud& window, const Pose& guess) const;
  /// Fine GICP alone, from a guess that odometry carried there from a window nearby.
  Placement Follow(const WindowCloud& window, const Pose& guess) const;

  /// How well what stands upright in a window lies at a refined pose.
  StructureFit Structure(const PlanQuery& query, const WallPlan& plan, const Pose& pose) const;
  /// The plan of this part of the map alone.
  WallPlan PlanOfTarget() const;

  /// The scans of a window, each refined on its own from where the window puts it. `scans` in their sensors' frames,
  /// `sensors[i]` T_window_sensor of scan i, `placed` T_map_window.
  std::vector<ScanPlacement> PlaceScans(const WindowCloud& window,
                                        std::span<const std::vector<Eigen::Vector3f>* const> scans,
                                        std::span<const Pose> sensors, const Pose& placed) const;

 private:
  struct Round {
    double correspondence;  // metres
    double robust_width;    // metres
    double tolerance;       // of GicpParameters: metres, and a tenth of it in radians
  };
  Placement PlaceBy(std::span<const Round> rounds, const WindowCloud& window, const Pose& guess) const;

  AlignParameters parameters_;
  SurfaceCloud target_;
  PointTree tree_;
  Coverage coverage_;
};

/// What every window that is believed must show, however it was placed: fitness, inliers, and surroundings that fix it
/// in every direction.
bool FitsMap(const Fit& fit, const AlignParameters& parameters);
/// What a window must show on top of that if its pose is no continuation of another one's.
bool StructureFits(const StructureFit& fit, const AlignParameters& parameters);
/// What a window found by descriptors, without a prior, must show on top of FitsMap.
bool FitsMapWithoutPrior(const Fit& fit, const AlignParameters& parameters);

/// Whether two places of windows follow from one another by odometry: `predicted` and `found` are poses of the same
/// window, `travel` the metres between the windows that they come from.
bool Agree(const Pose& predicted, const Pose& found, double travel, const AlignParameters& parameters);

}  // namespace mapkeep
