#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "client/cli/removal_score.h"
#include "client/simulator/session.h"
#include "core/dor/remover.h"

namespace mapkeep {

/// What became of the points of one kind of thing, or of one thing.
struct Fate {
  uint64_t points = 0;
  uint64_t removed = 0;
  uint64_t kept_as_ground = 0;  ///< of those that were not removed

  void Add(PointLabel label) {
    ++points;
    removed += label == PointLabel::kDynamic;
    kept_as_ground += label == PointLabel::kGround;
  }
  void Add(const Fate& other) {
    points += other.points;
    removed += other.removed;
    kept_as_ground += other.kept_as_ground;
  }
};

/// Rings of distance from the sensor: up to 10, 20, 40 m, and beyond.
inline constexpr std::array<double, 4> kRangeRings = {10, 20, 40, 1e9};

/// One object of a session, as far as the sensor saw it.
struct SeenObject {
  ObjectKind kind = ObjectKind::kFurniture;
  bool labelled_static = true, labelled_moving = false;
  double moved = 0;  ///< metres: farthest from where it was first seen, over the scans that have points of it
  size_t first_scan = 0, last_scan = 0;  ///< with points of it
  double range_sum = 0;                  ///< metres, over its points
  std::array<Fate, kRangeRings.size()> by_range;

  /// Scored as neither.
  bool IsUnsure() const { return !labelled_static && (!labelled_moving || moved < kLeastTravel); }

  Fate All() const {
    Fate all;
    for (const Fate& fate : by_range) all.Add(fate);
    return all;
  }
};

/// A cleaned session against its truth. Scored as moving is what SemanticKITTI labels so: "a vehicle or human gets the
/// corresponding moving class if it moved in some scan while observing them", in all scans of the session. What is
/// labelled moving but was never seen to come kLeastTravel away is unsure and not scored. Everything else is
/// static.
struct RemovalResult {
  RemovalScore score;
  RemovalScore as_labelled;  ///< by the labels alone
  uint64_t unsure = 0;       ///< points that are not scored
  std::map<uint32_t, SeenObject> objects;
};

/// `labels[i]` are the verdicts on the points of `truth[i]`.
RemovalResult ScoreRemoval(const SimulatedSession& session, std::span<const LabelledScan> truth,
                           std::span<const std::vector<PointLabel>> labels);

/// Adds up objects of one kind.
struct KindFate {
  std::array<Fate, kRangeRings.size()> by_range;
  std::array<Fate, 3> by_distance;  ///< moved up to 2 m, up to 10 m, farther
};

/// By "KIND" of scored moving objects if `moving`, of static ones if not.
std::map<std::string, KindFate> FatesByKind(const RemovalResult& result, bool moving);

}  // namespace mapkeep
