#pragma once

#include <absl/status/statusor.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <string>
#include <unordered_map>
#include <vector>

#include "core/registration/wall_plan.h"
#include "storage/map_store.h"

namespace mapkeep {

/// Plans of maps (core/registration/wall_plan.h), made once for each state of a tile, stored beside it, and kept in
/// memory across sessions and epochs: what a commit left alone is not looked at again, and a daemon that starts reads
/// plans, not voxels. Of each tile the state asked for last is kept, so that memory grows with the maps, not with their
/// history; an older one is read from the store again. Thread-safe.
class PlanCache {
 public:
  /// Keeps about `most_bytes` of tiles, those asked for last.
  explicit PlanCache(size_t most_bytes = size_t{256} << 20) : most_bytes_(most_bytes) {}

  /// Asked before each tile that is looked for, by any thread; false stops, with CANCELLED.
  using GoesOn = std::function<bool()>;

  /// The plan of a state of a map. Errors of the store are passed on. What was made before it was stopped is kept.
  absl::StatusOr<std::shared_ptr<const WallPlan>> PlanOf(const Snapshot& map, const GoesOn& goes_on = {});

  /// Tiles that were made, rather than found here or in the store, since the start,
  size_t made() const;
  /// and those of them that could not be stored.
  size_t not_stored() const;

  /// Bytes of tiles that it keeps.
  size_t bytes() const;

 private:
  struct Entry {
    std::string state;  ///< of the tile's content
    std::shared_ptr<const PlanPart> part;
    std::list<std::string>::iterator use;
  };

  std::shared_ptr<const PlanPart> Find(const std::string& tile, const std::string& state);
  void Store(const Snapshot& map, const TileEntry& tile, const PlanPart& plan);
  void Keep(const std::string& tile, const std::string& state, std::shared_ptr<const PlanPart> part);
  void Drop(const std::string& tile);

  const size_t most_bytes_;
  mutable std::mutex mutex_;
  std::unordered_map<std::string, Entry> parts_;  ///< by tile
  std::list<std::string> used_;                   ///< last first
  size_t bytes_ = 0, made_ = 0, not_stored_ = 0;
  std::string newest_state_;  ///< what `newest_` was made of
  std::shared_ptr<const WallPlan> newest_;
};

}  // namespace mapkeep
