#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <string>
#include <string_view>
#include <vector>

namespace mapkeep {

/// How a sensor looks around and how well it measures. Sensor frame: x forward, y left, z up.
struct SensorModel {
  std::string name;
  std::vector<double> elevations;  ///< radians, one a channel; of a rosette: the offset of its parallel lines
  size_t firings = 0;              ///< times that all channels fire in one scan
  bool rosette = false;            ///< two turning prisms instead of a turning head: never the same pattern twice
  double rosette_radius = 0;       ///< radians, half the field of view
  double period = 0.1;             ///< seconds a scan
  double height = 1.73;            ///< metres above the ground
  double min_range = 1.0;          ///< metres
  double max_range = 120.0;        ///< metres
  double range_noise = 0.02;       ///< metres, deviation of a range at normal incidence
  double drop_out = 0.01;          ///< share of pulses lost for no reason of the scene
  double divergence = 0.0015;      ///< radians, half angle of the beam
  double reach = 90.0;             ///< metres at which half the pulses come back from a 10 % target
};

/// hdl64 (Velodyne HDL-64E), os1-64 (Ouster OS1-64, 45 degrees), vlp16 (Velodyne VLP-16) or livox (an Avia-like
/// rosette of six lines looking forward), each at 10 Hz. INVALID_ARGUMENT that lists the names.
absl::StatusOr<SensorModel> SensorNamed(std::string_view name);

/// The names that SensorNamed knows.
std::vector<std::string> SensorNames();

/// Unit directions of scan `scan`, channel fastest, the order of time; the turning head starts at a `phase` of [0, 1)
/// firings, so that two scans from one place do not hit the same spots.
std::vector<Eigen::Vector3f> DirectionsOf(const SensorModel& sensor, size_t scan, double phase);

}  // namespace mapkeep
