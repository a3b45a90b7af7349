#include "tests/bench/lifelong_truth.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

namespace mapkeep {
namespace {

constexpr double kCell = 0.05;          // metres
constexpr int kRadiusCells = 2;         // 10 cm
constexpr size_t kRequiredCells = 400;  // 5 cm cells of an object seen by a session that has to be told: a square metre
constexpr size_t kRequiredBeams = 400;  // of a session through the place of something that has to be told
constexpr size_t kBeamStep = 4;         // beams that one which is kept stands for
constexpr int kGrace = 1;               // a change of today is followed today or tomorrow

uint64_t Pack(int64_t x, int64_t y, int64_t z) {
  const auto part = [](int64_t c) { return static_cast<uint64_t>(c + (1 << 20)) & 0x1fffff; };
  return part(x) << 42 | part(y) << 21 | part(z);
}
int64_t IndexOf(double c) { return static_cast<int64_t>(std::floor(c / kCell)); }

/// An object in one place: one that moved is another one there.
uint64_t PlaceOf(uint32_t id, const Pose& pose) {
  const Eigen::Vector3d t = pose.translation();
  return static_cast<uint64_t>(id) << 32 |
         (static_cast<uint64_t>(std::llround(t.x() * 2)) * 7919 + static_cast<uint64_t>(std::llround(t.y() * 2))) %
             (1U << 31);
}

// What a map of changes has to tell. People and lorries that wait through a whole session may be told.
bool HasToBeTold(const SceneObject& object) {
  return object.kind == ObjectKind::kCar || object.kind == ObjectKind::kConstruction ||
         object.kind == ObjectKind::kFence || object.kind == ObjectKind::kBuilding;
}

bool CanLeave(const SceneObject& object) {
  return HasToBeTold(object) || object.kind == ObjectKind::kLorry || object.kind == ObjectKind::kCyclist ||
         object.kind == ObjectKind::kPedestrian;
}

// Whether it stands where its track begins through the whole session.
bool Stays(const SceneObject& object) { return IsThere(object.state) && object.state != ObjectState::kMoving; }

Eigen::AlignedBox3d BoxOf(const SimulatedSession& session, const SceneObject& object, const Pose& pose) {
  const auto& [low, high] = session.mesh_bounds[object.mesh];
  Eigen::AlignedBox3d box;
  for (int corner = 0; corner < 8; ++corner) {
    box.extend(pose * Eigen::Vector3d((corner & 1) != 0 ? high.x() : low.x(), (corner & 2) != 0 ? high.y() : low.y(),
                                      (corner & 4) != 0 ? high.z() : low.z()));
  }
  return box;
}

}  // namespace

uint64_t PointCells::CellOf(const Eigen::Vector3d& point) {
  return Pack(IndexOf(point.x()), IndexOf(point.y()), IndexOf(point.z()));
}

bool PointCells::HasNear(const Eigen::Vector3d& point) const {
  const int64_t x = IndexOf(point.x()), y = IndexOf(point.y()), z = IndexOf(point.z());
  if (cells_.contains(Pack(x, y, z))) return true;
  for (int dz = -kRadiusCells; dz <= kRadiusCells; ++dz) {
    for (int dy = -kRadiusCells; dy <= kRadiusCells; ++dy) {
      for (int dx = -kRadiusCells; dx <= kRadiusCells; ++dx) {
        if (dx * dx + dy * dy + dz * dz > kRadiusCells * kRadiusCells) continue;
        if (cells_.contains(Pack(x + dx, y + dy, z + dz))) return true;
      }
    }
  }
  return false;
}

bool LifelongTruth::IsLookedAt(const Eigen::AlignedBox3d& box, const std::vector<Beam>& beams) {
  const Eigen::Array3f low = box.min().cast<float>(), high = box.max().cast<float>();
  size_t count = 0;
  for (const Beam& beam : beams) {
    // Where the beam, 0 at the sensor and 1 at its end, is between the two planes of each axis.
    const Eigen::Array3f way = (beam.to - beam.from).array();
    const Eigen::Array3f a = (low - beam.from.array()) / way, b = (high - beam.from.array()) / way;
    const float enters = a.min(b).maxCoeff(), leaves = a.max(b).minCoeff();
    count += enters <= leaves && leaves > 0 && enters < 1;
    if (count * kBeamStep >= kRequiredBeams) return true;
  }
  return false;
}

std::vector<TrueChange> LifelongTruth::AddDay(const SimulatedSession& session, std::span<const LabelledScan> scans) {
  ++day_;
  stands_ = {};
  static_points_.clear();
  beams_yesterday_ = std::move(beams_);
  beams_.clear();
  moved_yesterday_ = std::move(moving_points_);
  moving_points_.clear();
  std::map<uint32_t, const SceneObject*> objects;
  for (const SceneObject& object : session.objects) objects[object.id & 0xffff] = &object;

  // What stood there on earlier days and drives off today is a change of today, not something that always moved.
  std::map<uint32_t, Eigen::AlignedBox3d> leaving;
  for (const SceneObject& object : session.objects) {
    const Pose& pose = object.track.front().pose;
    if (!CanLeave(object) || object.state != ObjectState::kMoving || !known_.contains(PlaceOf(object.id, pose)))
      continue;
    leaving.emplace(object.id & 0xffff, BoxOf(session, object, pose));
  }

  // Today's points, thinned to a cell and an object.
  absl::flat_hash_set<uint64_t> taken, moving_taken;
  absl::flat_hash_map<uint32_t, std::pair<std::vector<Eigen::Vector3f>, absl::flat_hash_set<uint64_t>>> of_object;
  for (size_t i = 0; i < scans.size(); ++i) {
    for (size_t k = 0; k < scans[i].labels.size(); ++k) {
      const uint32_t label = scans[i].labels[k], id = ObjectOfLabel(label);
      const Eigen::Vector3d point = session.truth[i] * scans[i].scan.points[k].cast<double>();
      const uint64_t cell = PointCells::CellOf(point);
      if (k % kBeamStep == 0) beams_.push_back({session.truth[i].translation().cast<float>(), point.cast<float>()});
      if (ClassOfLabel(label) == kMovingLabel) {
        const auto left = leaving.find(id);
        if (left != leaving.end() && left->second.contains(point)) {
          stands_.Add(point);
          continue;
        }
        if (moving_taken.insert(cell).second) moving_points_.push_back({point.cast<float>(), id});
        continue;
      }
      if (ClassOfLabel(label) != kStaticLabel) continue;
      stands_.Add(point);
      if (taken.insert(cell).second) static_points_.push_back({point.cast<float>(), id});
      const auto known = objects.find(id);
      if (known == objects.end() || !CanLeave(*known->second)) {
        lasting_.Add(point);
        continue;
      }
      auto& [points, cells] = of_object[id];
      if (cells.insert(cell).second) points.push_back(point.cast<float>());
    }
  }

  std::vector<TrueChange> changes;
  const absl::flat_hash_set<uint64_t> stood = std::move(standing_);
  standing_.clear();
  for (const SceneObject& object : session.objects) {
    if (CanLeave(object) && Stays(object)) standing_.insert(PlaceOf(object.id, object.track.front().pose));
  }
  for (const SceneObject& object : session.objects) {
    if (!CanLeave(object)) continue;
    const Pose& pose = object.track.front().pose;
    const uint64_t place = PlaceOf(object.id, pose);
    const auto seen = of_object.find(object.id & 0xffff);
    const size_t seen_cells = seen == of_object.end() ? 0 : seen->second.first.size();
    const auto went = [&](const Pose& from) {
      const auto before = known_.find(PlaceOf(object.id, from));
      const bool known = before != known_.end();
      if (known && !before->second.gone.has_value()) before->second.gone = day_;
      changes.push_back(
          {.id = object.id,
           .kind = std::string(NameOf(object.kind)),
           .appeared = false,
           .required = known && RequiresTelling(before->second) && IsLookedAt(BoxOf(session, object, from), beams_),
           .parked_days = known ? before->second.last_day - before->second.first_day + 1 : 0,
           .box = BoxOf(session, object, from)});
    };
    const auto came = [&] {
      changes.push_back({.id = object.id,
                         .kind = std::string(NameOf(object.kind)),
                         .appeared = true,
                         .required = HasToBeTold(object) && seen_cells >= kRequiredCells &&
                                     IsLookedAt(BoxOf(session, object, pose), beams_yesterday_),
                         .box = BoxOf(session, object, pose)});
    };
    if (object.previous.has_value()) went(*object.previous);
    switch (object.state) {
      case ObjectState::kArrived:
      case ObjectState::kBuilt:
      case ObjectState::kMoved:
        came();
        break;
      case ObjectState::kParked:
        // Traffic that waits through the whole session is new like what was parked in the night.
        if (day_ > 0 && !stood.contains(place)) came();
        break;
      case ObjectState::kLeft:
      case ObjectState::kTornDown:
        went(pose);
        break;
      case ObjectState::kMoving:
        // Drives off today: told or not, neither is wrong.
        if (known_.contains(place)) {
          went(pose);
          changes.back().required = false;
        }
        break;
      default:
        break;
    }
    if (!Stays(object) || seen == of_object.end()) continue;
    Known& known = known_
                       .try_emplace(place, Known{.kind = std::string(NameOf(object.kind)),
                                                 .has_to_be_told = HasToBeTold(object),
                                                 .first_day = day_,
                                                 .last_day = day_,
                                                 .box = BoxOf(session, object, pose)})
                       .first->second;
    known.last_day = day_;
    known.gone.reset();
    for (const Eigen::Vector3f& point : seen->second.first) {
      if (known.cells.insert(PointCells::CellOf(point.cast<double>())).second) known.points.push_back(point);
    }
  }
  // Traffic that waited through a whole session is no object of the next one.
  for (auto& [place, known] : known_) {
    if (known.gone.has_value() || standing_.contains(place)) continue;
    known.gone = day_;
    changes.push_back({.id = static_cast<uint32_t>(place >> 32),
                       .kind = known.kind,
                       .appeared = false,
                       .required = RequiresTelling(known) && IsLookedAt(known.box, beams_),
                       .parked_days = known.last_day - known.first_day + 1,
                       .box = known.box});
  }
  return changes;
}

bool LifelongTruth::RequiresTelling(const Known& known) const {
  return known.has_to_be_told && known.last_day == day_ - 1 && known.points.size() >= kRequiredCells;
}

std::array<uint64_t, 2> LifelongTruth::MovingPointsIn(const Eigen::AlignedBox3d& box) const {
  const auto count = [&box](const std::vector<Point>& points) {
    return static_cast<uint64_t>(
        std::ranges::count_if(points, [&](const Point& p) { return box.contains(p.position.cast<double>()); }));
  };
  return {count(moving_points_), count(moved_yesterday_)};
}

DayScore LifelongTruth::Score(const PointCells& map, const std::function<void(const JudgedPoint&)>& judged) const {
  DayScore score;
  const auto tell = [&judged](const Eigen::Vector3f& position, uint32_t id, JudgedAs as, bool right) {
    if (judged) judged({position.cast<double>(), id, as, right});
  };
  absl::flat_hash_set<uint32_t> new_today;
  for (const auto& [place, known] : known_) {
    if (known.first_day == day_ && day_ > 0) new_today.insert(static_cast<uint32_t>(place >> 32) & 0xffff);
  }
  for (const Point& point : static_points_) {
    const bool there = map.HasNear(point.position.cast<double>());
    const bool is_new = new_today.contains(point.id);
    (is_new ? score.just_arrived : score.statics).Add(there);
    if (!is_new) tell(point.position, point.id, JudgedAs::kStatic, there);
  }
  // Where something stands, the map has a right to a point, whether anybody saw it today or not: the ground below the
  // car that stands today where another stood yesterday.
  PointCells remains;
  for (const auto& [place, known] : known_) {
    if (known.gone.has_value()) continue;
    for (const Eigen::Vector3f& point : known.points) remains.Add(point.cast<double>());
  }
  const auto scored = [&](const Eigen::Vector3f& point) {
    const Eigen::Vector3d at = point.cast<double>();
    return !stands_.HasNear(at) && !lasting_.HasNear(at) && !remains.HasNear(at);
  };
  for (const Point& point : moving_points_) {
    if (!scored(point.position)) continue;
    const bool right = !map.HasNear(point.position.cast<double>());
    score.dynamics.Add(right);
    tell(point.position, point.id, JudgedAs::kMoving, right);
  }
  for (const auto& [place, known] : known_) {
    if (!known.gone.has_value()) continue;
    const int since = day_ - *known.gone;  // 0: it is gone for the first time today
    for (const Eigen::Vector3f& point : known.points) {
      if (!scored(point)) continue;
      const bool right = !map.HasNear(point.cast<double>());
      if (since < kGrace) {
        score.just_left.Add(right);
        continue;
      }
      score.dynamics.Add(right);
      tell(point, static_cast<uint32_t>(place >> 32), JudgedAs::kLeft, right);
      if (since == kGrace) score.by_days[known.last_day - known.first_day + 1].Add(right);
    }
  }
  return score;
}

}  // namespace mapkeep
