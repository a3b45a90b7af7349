#pragma once

#include <absl/container/flat_hash_map.h>
#include <absl/container/flat_hash_set.h>

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client/simulator/session.h"

namespace mapkeep {

/// Centimetre cells of space, 5 cm an axis: points that are compared within a radius.
class PointCells {
 public:
  void Add(const Eigen::Vector3d& point) { cells_.insert(CellOf(point)); }
  /// Whether a cell with a point lies within 10 cm of this one's.
  bool HasNear(const Eigen::Vector3d& point) const;
  size_t size() const { return cells_.size(); }

 private:
  friend class LifelongTruth;
  static uint64_t CellOf(const Eigen::Vector3d& point);
  absl::flat_hash_set<uint64_t> cells_;
};

/// One object that changed between two sessions, as truth has it.
struct TrueChange {
  uint32_t id = 0;
  std::string kind;
  bool appeared = false;  ///< else it went
  bool required = false;  ///< it was seen well enough, before and after, to have to be told
  int parked_days = 0;    ///< sessions that something that went had been there
  Eigen::AlignedBox3d box;
};

/// Right and wrong points.
struct PointScore {
  uint64_t right = 0, all = 0;
  double Percent() const { return all == 0 ? 100 : 100.0 * static_cast<double>(right) / static_cast<double>(all); }
  void Add(bool is_right) {
    ++all;
    right += is_right ? 1 : 0;
  }
};

/// A map's static points against one day's truth.
struct DayScore {
  PointScore statics;  ///< SA: what stands, and has stood for two sessions, is in the map
  /// DA: what moved, or left two sessions ago or earlier, is not. What stood there on earlier days and drives off today
  /// leaves today.
  PointScore dynamics;
  PointScore just_left, just_arrived;  ///< of today's changes: how much of them the map follows at once
  std::map<int, PointScore> by_days;   ///< of dynamics: what left two sessions ago, by the days that it had been parked
};

/// What a judged point belongs to.
enum class JudgedAs : uint8_t { kStatic, kMoving, kLeft };

/// One point that was scored for SA or DA.
struct JudgedPoint {
  Eigen::Vector3d position;
  uint32_t id = 0;  ///< of its object
  JudgedAs as = JudgedAs::kStatic;
  bool right = false;
};

/// The truth about a row of sessions, day by day: what stands, what moved and what has left.
class LifelongTruth {
 public:
  /// The next session, with the labelled points of its scans. Gives what changed since the one before.
  std::vector<TrueChange> AddDay(const SimulatedSession& session, std::span<const LabelledScan> scans);

  /// How many of today's and of yesterday's moving points lie in a box: of whatever moved there.
  std::array<uint64_t, 2> MovingPointsIn(const Eigen::AlignedBox3d& box) const;

  /// Scores the static points of a map after the last session that was added. `judged`, if given, sees every point that
  /// counts for SA or DA.
  DayScore Score(const PointCells& map, const std::function<void(const JudgedPoint&)>& judged = {}) const;

 private:
  /// One object through the days.
  struct Known {
    std::string kind;
    bool has_to_be_told = false;
    int first_day = 0, last_day = 0;  ///< on which it was seen to stand there
    std::optional<int> gone;          ///< the first day on which it is not there any more
    Eigen::AlignedBox3d box;
    std::vector<Eigen::Vector3f> points;  ///< thinned
    absl::flat_hash_set<uint64_t> cells;  ///< of them
  };
  /// Whether its going today has to be told, if somebody looks.
  bool RequiresTelling(const Known& known) const;

  struct Point {
    Eigen::Vector3f position;
    uint32_t id = 0;
  };

  /// A beam of a scan, from the sensor to what it hit.
  struct Beam {
    Eigen::Vector3f from, to;
  };
  /// Whether beams enough pass through a box, or end in it, that whoever looks can say what is there.
  static bool IsLookedAt(const Eigen::AlignedBox3d& box, const std::vector<Beam>& beams);

  int day_ = -1;
  std::vector<Beam> beams_, beams_yesterday_;  ///< one of kBeamStep
  PointCells stands_;                          ///< today's static points, all scans
  PointCells lasting_;                         ///< all days' static points of what never leaves
  std::vector<Point> static_points_;           ///< thinned
  std::vector<Point> moving_points_;
  std::vector<Point> moved_yesterday_;
  absl::flat_hash_set<uint64_t> standing_;      ///< today, by id and place: what can leave, seen or not
  absl::flat_hash_map<uint64_t, Known> known_;  ///< by id and place: what can leave
};

}  // namespace mapkeep
