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

namespace {

/// The largest of differs(pose, first pose) over the keys inside [begin, end] and its ends: between keys things go
/// straight, so that nothing is farther off.
template <typename Difference>
double LargestWithin(const Track& track, double begin, double end, const Difference& difference) {
  if (track.size() < 2) return 0;
  std::optional<Pose> first;
  double largest = 0;
  const auto look = [&](double time) {
    const std::optional<Pose> pose = PoseAt(track, time);
    if (!pose.has_value()) return;
    if (!first.has_value()) first = pose;
    largest = std::max(largest, difference(*pose, *first));
  };
  look(std::max(begin, track.front().time));
  for (const TrackKey& key : track) {
    if (key.time > begin && key.time < end) look(key.time);
  }
  look(std::min(end, track.back().time));
  return largest;
}

double DistanceBetween(const Pose& a, const Pose& b) { return (a.translation() - b.translation()).norm(); }

}  // namespace

bool MovesWithin(const Track& track, double begin, double end) {
  constexpr double kMillimetre = 1e-3, kMilliradian = 1e-3;
  return LargestWithin(track, begin, end, [](const Pose& a, const Pose& b) {
           return std::max(DistanceBetween(a, b) / kMillimetre, AngleBetween(a, b) / kMilliradian);
         }) > 1;
}

double FarthestWithin(const Track& track, double begin, double end) {
  return LargestWithin(track, begin, end, DistanceBetween);
}

}  // namespace mapkeep
