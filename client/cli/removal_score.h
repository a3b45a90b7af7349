#pragma once

#include <cmath>
#include <cstdint>

namespace mapkeep {

/// Points as the KTH dynamic-map benchmark counts them, and its rates in percent (100 where there is nothing to count).
struct RemovalScore {
  uint64_t statics = 0, kept = 0, moving = 0, removed = 0;

  double sa() const { return Percent(kept, statics); }    ///< true static points that were kept
  double da() const { return Percent(removed, moving); }  ///< true moving points that were removed
  double aa() const { return std::sqrt(sa() * da()); }

  static double Percent(uint64_t part, uint64_t whole) {
    return whole == 0 ? 100 : 100.0 * static_cast<double>(part) / static_cast<double>(whole);
  }
};

}  // namespace mapkeep
