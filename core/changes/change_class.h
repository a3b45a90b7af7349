#pragma once

#include <cstdint>

namespace mapkeep {

/// What became of something between two states of the map.
enum class ChangeClass : uint8_t { kAppeared = 0, kDisappeared = 1, kUnstable = 2 };

}  // namespace mapkeep
