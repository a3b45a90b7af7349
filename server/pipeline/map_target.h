#pragma once

#include "core/registration/target_map.h"
#include "server/pipeline/plan_cache.h"
#include "storage/map_store.h"

namespace mapkeep {

/// A state of a map as registration reads it: its static voxels, block by block, and what the global matcher is to
/// search, described when first asked for. `goes_on` as of PlanCache::PlanOf. `base` and `plans` outlive it.
TargetMap TargetOf(const Snapshot& base, PlanCache& plans, PlanCache::GoesOn goes_on,
                   const MatcherParameters& parameters);

/// The static voxels of these blocks, all there. Metres, relative to the map's origin.
absl::StatusOr<RegistrationTarget> StaticVoxels(const Snapshot& base, std::span<const BlockKey> keys);

/// The blocks of these keys, all there.
absl::StatusOr<std::vector<std::shared_ptr<const Block>>> ReadBlocks(const Snapshot& snapshot,
                                                                     std::span<const BlockKey> keys);

}  // namespace mapkeep
