#pragma once

#include <chrono>
#include <functional>

namespace mapkeep {

/// Seconds since 1970 (UTC). Given to what expires, so that tests need not wait.
using Clock = std::function<double()>;

/// The machine's own.
inline double SystemSeconds() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

}  // namespace mapkeep
