#pragma once

#include <compare>
#include <cstdint>

namespace mapkeep {

/// The commit attempt, and its round, that wrote a value. No two writes of a map have the same.
struct WriteId {
  uint64_t attempt = 0;
  uint32_t round = 0;
  auto operator<=>(const WriteId&) const = default;
};

}  // namespace mapkeep
