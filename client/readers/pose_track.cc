#include "client/readers/pose_track.h"

#include <algorithm>

namespace mapkeep {
namespace {

/// share outside [0, 1] goes on beyond the ends.
Pose Between(const Pose& a, const Pose& b, double share) {
  const Eigen::AngleAxisd turn(a.linear().transpose() * b.linear());
  Pose pose = Pose::Identity();
  pose.linear() = a.linear() * Eigen::AngleAxisd(share * turn.angle(), turn.axis()).toRotationMatrix();
  pose.translation() = a.translation() + share * (b.translation() - a.translation());
  return pose;
}

}  // namespace

void PoseTrack::Add(double time, const Pose& pose) { entries_.push_back({time, pose}); }

void PoseTrack::Sort() {
  std::ranges::stable_sort(entries_, {}, &Entry::time);
  const auto same = [](const Entry& a, const Entry& b) { return a.time == b.time; };
  entries_.erase(std::unique(entries_.begin(), entries_.end(), same), entries_.end());
}

PoseTrack PoseTrack::Followed(const Pose& pose) const {
  PoseTrack track = *this;
  for (Entry& entry : track.entries_) entry.pose = entry.pose * pose;
  return track;
}

std::optional<Pose> PoseTrack::At(double time) const { return Near(time, 0); }

std::optional<Pose> PoseTrack::Near(double time, double beyond) const {
  if (empty() || time < first_time() - beyond || time > last_time() + beyond) return std::nullopt;
  if (size() == 1) return entries_.front().pose;
  const auto found = std::ranges::lower_bound(entries_, time, {}, &Entry::time);
  const size_t next = std::clamp<size_t>(found - entries_.begin(), 1, size() - 1);
  const Entry &a = entries_[next - 1], &b = entries_[next];
  if (time == b.time) return b.pose;
  if (b.time - a.time > kLongestGap) return time == a.time ? std::optional(a.pose) : std::nullopt;
  return Between(a.pose, b.pose, (time - a.time) / (b.time - a.time));
}

}  // namespace mapkeep
