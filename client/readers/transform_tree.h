#pragma once

#include <absl/status/statusor.h>

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "client/readers/pose_track.h"
#include "client/readers/ros_messages.h"

namespace mapkeep {

/// Where frames are in one another over time, as tf keeps it: every frame has one parent.
class TransformTree {
 public:
  /// A pose of `child` in `frame`; a static one holds at all times.
  void Add(const PoseMessage& transform, bool is_static);
  /// After the last Add.
  void Sort();

  bool empty() const { return links_.empty(); }

  /// The frames above `frame`, itself first, the root last.
  std::vector<std::string> ChainOf(const std::string& frame) const;

  /// The pose of `frame` in `ancestor` at a time; nothing where a link is not known then. Both must be in one chain.
  std::optional<Pose> At(const std::string& ancestor, const std::string& frame, double time) const;

  /// The pose of `frame` in `other`, through a common ancestor, if static transforms alone lead from one to the other.
  std::optional<Pose> Fixed(const std::string& other, const std::string& frame) const;

  /// Whether a link between the two moves.
  bool Moves(const std::string& ancestor, const std::string& frame) const;

 private:
  struct Link {
    std::string parent;
    bool is_static = false;
    Pose fixed = Pose::Identity();
    PoseTrack track;
  };
  std::map<std::string, Link> links_;  ///< by child
};

}  // namespace mapkeep
