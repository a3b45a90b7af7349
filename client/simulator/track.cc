#include "client/simulator/track.h"

#include <algorithm>

namespace mapkeep {

Pose Between(const Pose& a, const Pose& b, double fraction) {
  Pose pose = Pose::Identity();
  pose.linear() =
      Eigen::Quaterniond(a.linear()).slerp(fraction, Eigen::Quaterniond(b.linear())).normalized().toRotationMatrix();
  pose.translation() = (1 - fraction) * a.translation() + fraction * b.translation();
  return pose;
}

std::optional<Pose> PoseAt(const Track& track, double time) {
  if (track.empty()) return std::nullopt;
  if (track.size() == 1) return track.front().pose;
  if (time < track.front().time || time > track.back().time) return std::nullopt;
  const auto after =
      std::upper_bound(track.begin(), track.end(), time, [](double t, const TrackKey& key) { return t < key.time; });
  if (after == track.end()) return track.back().pose;
  const TrackKey &a = *(after - 1), &b = *after;
  return Between(a.pose, b.pose, (time - a.time) / (b.time - a.time));
}

bool MovesWithin(const Track& track, double begin, double end) {
  if (track.size() < 2) return false;
  std::optional<Pose> first;
  const auto differs = [&](double time) {
    const std::optional<Pose> pose = PoseAt(track, time);
    if (!pose.has_value()) return false;
    if (!first.has_value()) first = pose;
    return (pose->translation() - first->translation()).norm() > 1e-3 || AngleBetween(*pose, *first) > 1e-3;
  };
  if (differs(std::max(begin, track.front().time)) || differs(std::min(end, track.back().time))) return true;
  return std::any_of(track.begin(), track.end(),
                     [&](const TrackKey& key) { return key.time > begin && key.time < end && differs(key.time); });
}

}  // namespace mapkeep
