#include "client/cli/initial_pose.h"

#include <cmath>

namespace mapkeep {

void BeginAt(const InitialPose& start, std::span<Pose> poses) {
  const Eigen::Vector3d heading = poses.front().linear().col(0);
  const double turn = start.yaw - std::atan2(heading.y(), heading.x());
  const Pose shift = Eigen::Translation3d(start.position) * Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()) *
                     Eigen::Translation3d(-poses.front().translation());
  for (Pose& pose : poses) pose = shift * pose;
}

}  // namespace mapkeep
