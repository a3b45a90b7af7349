#pragma once

#include <absl/status/status.h>
#include <oneapi/tbb/parallel_for.h>

#include <atomic>
#include <cstddef>
#include <vector>

namespace mapkeep {

/// Calls work(i) for i in [0, count) on the calling oneTBB arena and gives the error of the lowest i that failed. Once
/// one has failed, later ones may be left out.
template <typename Work>
absl::Status ParallelFor(size_t count, const Work& work) {
  std::vector<absl::Status> statuses(count);
  std::atomic<size_t> first_failed = count;
  tbb::parallel_for(size_t{0}, count, [&](size_t i) {
    if (i > first_failed) return;
    statuses[i] = work(i);
    if (statuses[i].ok()) return;
    for (size_t known = first_failed; i < known && !first_failed.compare_exchange_weak(known, i);) continue;
  });
  return first_failed == count ? absl::OkStatus() : statuses[first_failed];
}

}  // namespace mapkeep
