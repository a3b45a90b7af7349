#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "client/simulator/session.h"
#include "tests/bench/lifelong_truth.h"

namespace mapkeep {

/// Where the points of one day stood after each step of the pipeline.
struct DayCells {
  PointCells kept;        ///< points of the session that removal kept, in the session's own labels
  PointCells map_all;     ///< of the map, static or not
  PointCells map_static;  ///< of the map's static voxels: what is scored
};

/// Which step lost the points that a day's score misses, object by object.
class LifelongBreakdown {
 public:
  LifelongBreakdown(const SimulatedSession& session, const DayCells& cells) : session_(session), cells_(cells) {}

  void Add(const JudgedPoint& point);
  /// A table by kind of object and distance, and the worst objects.
  void Print() const;

 private:
  enum Cause { kRight, kRemoved, kDropped, kFiltered, kKept, kStored, kCauses };
  struct Counts {
    uint64_t all = 0;
    std::array<uint64_t, kCauses> by_cause{};
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  };
  Cause CauseOf(const JudgedPoint& point) const;

  const SimulatedSession& session_;
  const DayCells& cells_;
  std::map<std::tuple<JudgedAs, std::string, int>, Counts> by_kind_;  // and ring of distance
  std::map<std::pair<JudgedAs, uint32_t>, Counts> by_object_;
};

}  // namespace mapkeep
