#pragma once

#include <optional>
#include <vector>

#include "core/geometry/pose.h"

namespace mapkeep {

/// Where something is at a time.
struct TrackKey {
  double time = 0;  ///< seconds since the start of the session
  Pose pose = Pose::Identity();
};

/// Where something is in one session: keys in the order of time. One key: it stands there all the time. More: it moves
/// from one to the next and is nowhere before the first and after the last.
using Track = std::vector<TrackKey>;

/// Straight between keys; nothing when the thing is not there.
std::optional<Pose> PoseAt(const Track& track, double time);

/// Whether anything of the track inside [begin, end] differs from its start by more than a millimetre or a milliradian.
bool MovesWithin(const Track& track, double begin, double end);

/// How far the thing comes from where it is when it is first there inside [begin, end], in metres.
double FarthestWithin(const Track& track, double begin, double end);

/// On the way from `a` (fraction 0) to `b` (fraction 1): straight, turning evenly.
Pose Between(const Pose& a, const Pose& b, double fraction);

}  // namespace mapkeep
