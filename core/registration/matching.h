#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/registration/descriptor_index.h"
#include "core/registration/descriptors.h"

namespace mapkeep {

/// A point of the source and the point of the target whose descriptors chose each other.
struct Match {
  uint32_t source = 0, target = 0;
  float ratio = 1;  ///< squared distance of the descriptors over that to the second best target: small is distinctive
};

struct MatchingParameters {
  double max_ratio = 0.97;     ///< of the squared distances to the best and the second best descriptor
  size_t max_queries = 12000;  ///< descriptors of the source that are looked up, spread evenly over it
  size_t max_matches = 5000;   ///< the most distinctive
  size_t probes = 6;           ///< words of the index that are searched
};

/// Whether a point of the source may be matched with one of the target. Called from several threads.
using AdmitMatch = std::function<bool(uint32_t source, uint32_t target)>;

/// The matches whose descriptors are each other's nearest and whose ratio is below the largest allowed, most
/// distinctive first. `target` is what the index was made from. Parallel on the calling oneTBB arena; the same on any
/// number of threads. With `admit`, all this among the pairs that it says yes to.
std::vector<Match> MatchDescriptors(std::span<const Descriptor> source, std::span<const Descriptor> target,
                                    const DescriptorIndex& target_index, const MatchingParameters& parameters,
                                    const AdmitMatch& admit = {});

}  // namespace mapkeep
