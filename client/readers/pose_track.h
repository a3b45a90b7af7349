#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "core/geometry/pose.h"

namespace mapkeep {

/// Poses of one thing over time, and in between.
class PoseTrack {
 public:
  static constexpr double kLongestGap = 1;  ///< seconds between two poses across which nothing is interpolated

  /// Seconds; in any order. Of two poses of one time the first one given counts.
  void Add(double time, const Pose& pose);
  /// After the last Add, before the first At.
  void Sort();

  /// The track of what is fixed at `pose` on the thing.
  PoseTrack Followed(const Pose& pose) const;

  bool empty() const { return entries_.empty(); }
  size_t size() const { return entries_.size(); }
  double first_time() const { return entries_.front().time; }
  double last_time() const { return entries_.back().time; }

  /// The pose at a time: translation linear, rotation along the shortest arc. Nothing before the first pose, after the
  /// last, or within a gap longer than kLongestGap.
  std::optional<Pose> At(double time) const;

  /// The same for times that may lie up to `beyond` seconds outside: the motion of the nearest interval goes on.
  std::optional<Pose> Near(double time, double beyond) const;

 private:
  struct Entry {
    double time;
    Pose pose;
  };
  std::vector<Entry> entries_;
};

}  // namespace mapkeep
