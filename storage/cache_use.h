#pragma once

#include <cstddef>
#include <cstdint>

namespace mapkeep {

/// How a cache fares.
struct CacheUse {
  uint64_t hits = 0, misses = 0;  ///< since the start
  size_t bytes = 0;               ///< held now
};

}  // namespace mapkeep
