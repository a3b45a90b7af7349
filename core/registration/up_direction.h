#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "core/registration/surface_normals.h"

namespace mapkeep {

/// One flat piece of surface, in the frame whose up direction is asked for.
struct SurfacePatch {
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< unit, towards the sensor
  bool below_sensor = false;                         ///< lies below the sensor, by the sensor's own z axis
};

/// The direction that points up in the frame of the patches, from the ground below the sensor, refined by walls: on a
/// slope the ground is tilted and walls are still vertical. `sensor_up` is the mean z axis of the sensor in that frame,
/// which tells the ground from a wall when the frame itself stands on its side. Nothing if there is too little ground
/// to tell.
std::optional<Eigen::Vector3d> EstimateUpDirection(std::span<const SurfacePatch> patches,
                                                   const Eigen::Vector3d& sensor_up);

}  // namespace mapkeep
