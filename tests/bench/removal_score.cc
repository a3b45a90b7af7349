#include "tests/bench/removal_score.h"

#include <algorithm>
#include <optional>
#include <unordered_map>

namespace mapkeep {
namespace {

size_t RingOf(double range) {
  size_t ring = 0;
  while (range > kRangeRings[ring]) ++ring;
  return ring;
}

}  // namespace

RemovalResult ScoreRemoval(const SimulatedSession& session, std::span<const LabelledScan> truth,
                           std::span<const std::vector<PointLabel>> labels) {
  RemovalResult result;
  std::unordered_map<uint32_t, const SceneObject*> known;
  for (const SceneObject& object : session.objects) known[object.id] = &object;
  std::unordered_map<uint32_t, Eigen::Vector3d> first_seen;
  for (size_t i = 0; i < truth.size(); ++i) {
    const double time = session.times[i] - session.times[0];
    uint32_t last = ~uint32_t{0};
    SeenObject* seen = nullptr;
    for (size_t k = 0; k < truth[i].labels.size(); ++k) {
      const uint32_t label = truth[i].labels[k];
      const uint32_t id = ObjectOfLabel(label);
      if (id != last) {
        last = id;
        seen = &result.objects[id];
        const SceneObject* object = known.contains(id) ? known[id] : nullptr;
        if (seen->range_sum == 0) {
          seen->first_scan = i;
          if (object != nullptr) seen->kind = object->kind;
        }
        seen->last_scan = i;
        seen->labelled_static = ClassOfLabel(label) == kStaticLabel;
        seen->labelled_moving = ClassOfLabel(label) == kMovingLabel;
        const std::optional<Pose> pose = object != nullptr ? PoseAt(object->track, time) : std::nullopt;
        if (pose.has_value()) {
          const Eigen::Vector3d first = first_seen.try_emplace(id, pose->translation()).first->second;
          seen->moved = std::max(seen->moved, (pose->translation() - first).norm());
        }
      }
      const double range = truth[i].scan.points[k].norm();
      seen->range_sum += range;
      seen->by_range[RingOf(range)].Add(labels[i][k]);
    }
  }
  for (const auto& [id, object] : result.objects) {
    const Fate all = object.All();
    const auto add = [&](RemovalScore& score) {
      (object.labelled_moving ? score.moving : score.statics) += all.points;
      (object.labelled_moving ? score.removed : score.kept) +=
          object.labelled_moving ? all.removed : all.points - all.removed;
    };
    if (object.labelled_static || object.labelled_moving) add(result.as_labelled);
    if (object.IsUnsure()) {
      result.unsure += all.points;
    } else {
      add(result.score);
    }
  }
  return result;
}

std::map<std::string, KindFate> FatesByKind(const RemovalResult& result, bool moving) {
  std::map<std::string, KindFate> kinds;
  for (const auto& [id, object] : result.objects) {
    if (object.labelled_moving != moving || object.IsUnsure()) continue;
    KindFate& kind = kinds[std::string(NameOf(object.kind))];
    for (size_t ring = 0; ring < kRangeRings.size(); ++ring) kind.by_range[ring].Add(object.by_range[ring]);
    kind.by_distance[object.moved <= 2 ? 0 : object.moved <= 10 ? 1 : 2].Add(object.All());
  }
  return kinds;
}

}  // namespace mapkeep
