#pragma once

#include <absl/container/flat_hash_map.h>

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace mapkeep {

/// The height of the ground, cell by cell: the local h_g of section 3.3. A cell may have several levels (a bridge over
/// a road, the storeys of a car park).
class Ground {
 public:
  struct Parameters {
    double cell = 0.5;  ///< metres
    double step = 0.3;  ///< ground continues where heights of neighbouring cells differ by less, metres
  };

  Ground() = default;

  /// `anchors` lie on surfaces whose normal is close to the vertical: ground, but also roofs and tables. What of them
  /// is ground is what can be reached from below the sensor's way (`sensors`) without a step and does not stand on
  /// other ground, as bonnets do. Independent of the order of the anchors. Metres.
  Ground(std::span<const Eigen::Vector3d> anchors, std::span<const Eigen::Vector3d> sensors,
         const Parameters& parameters);

  /// The ground level of the point's cell, or of the nearest cells with one up to 3 cells away, that is nearest to its
  /// height; nothing where no ground is known.
  std::optional<double> HeightNear(const Eigen::Vector3d& point) const;

  /// Height of the sensor above the ground it moves on, metres; 0 if no ground was found.
  double sensor_height() const { return sensor_height_; }

 private:
  using Cell = std::pair<int32_t, int32_t>;
  Cell CellOf(const Eigen::Vector3d& point) const;

  Parameters parameters_;
  double sensor_height_ = 0;
  absl::flat_hash_map<Cell, std::vector<double>> levels_;  // rising
};

}  // namespace mapkeep
