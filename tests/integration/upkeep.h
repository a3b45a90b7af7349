#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tests/integration/robot.h"

namespace mapkeep {

/// `admin check` and `admin replay`, for as long as they take; fail the test if the call does.
v1::VerifyMapResponse Verify(Robot& robot, const std::string& map);
v1::ReplayMapResponse Replay(Robot& robot, const std::string& map);

/// Each of the map's sessions once, nothing wrong with it, and the same again from its scans.
void ExpectWhole(Robot& robot, const std::string& map, uint64_t sessions);

/// The sessions that made the map, in the order of its epochs.
std::vector<std::string> SessionsOf(Robot& robot, const std::string& map);

}  // namespace mapkeep
