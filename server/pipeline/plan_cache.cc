#include "server/pipeline/plan_cache.h"

#include <absl/strings/str_cat.h>

#include <utility>

#include "server/pipeline/map_target.h"
#include "server/pipeline/parallel.h"
#include "server/pipeline/plan_codec.h"

namespace mapkeep {
namespace {

size_t BytesOf(const PlanPart& part, const std::string& tile) {
  return part.walls.size() * sizeof(PlanWall) + part.floors.size() * sizeof(PlanFloor) + 2 * tile.size() + 160;
}

std::string NameOf(const Snapshot& map, const TileEntry& tile) {
  return absl::StrCat(map.map().incarnation, " ", static_cast<uint64_t>(tile.key));
}

// Two contents of a tile never share it.
std::string StateOf(const TileEntry& tile) { return absl::StrCat(tile.version.attempt, " ", tile.version.round); }

absl::StatusOr<PlanPart> PlanOfTile(const Snapshot& map, TileKey tile) {
  const absl::StatusOr<std::vector<BlockKey>> keys = map.BlocksOf(tile);
  if (!keys.ok()) return keys.status();
  const absl::StatusOr<RegistrationTarget> voxels = StaticVoxels(map, *keys);
  if (!voxels.ok()) return voxels.status();
  return mapkeep::PlanOf(voxels->points, voxels->normals);
}

// NOT_FOUND if nobody stored one; whatever else is wrong with it, it can be made anew.
absl::StatusOr<PlanPart> StoredPlan(const Snapshot& map, const TileEntry& tile) {
  const auto stored = map.ReadDerived(tile);
  if (!stored.ok()) return stored.status();
  if (!*stored) return absl::NotFoundError("no plan is stored");
  return DecodePlan(**stored);
}

}  // namespace

// That a plan cannot be stored (a full disk) costs time later, and nothing now.
void PlanCache::Store(const Snapshot& map, const TileEntry& tile, const PlanPart& plan) {
  const absl::StatusOr<std::string> bytes = EncodePlan(plan);
  const absl::Status stored = bytes.ok() ? map.StoreDerived(tile, *bytes) : bytes.status();
  const std::lock_guard lock(mutex_);
  ++made_;
  if (!stored.ok()) ++not_stored_;
}

absl::StatusOr<std::shared_ptr<const WallPlan>> PlanCache::PlanOf(const Snapshot& map, const GoesOn& goes_on) {
  const std::string epoch = absl::StrCat(map.map().incarnation, " ", map.epoch());
  {
    const std::lock_guard lock(mutex_);
    if (newest_ && newest_state_ == epoch) return newest_;
  }
  const absl::StatusOr<std::vector<TileEntry>> tiles = map.TileEntries({});
  if (!tiles.ok()) return tiles.status();
  std::vector<std::shared_ptr<const PlanPart>> parts(tiles->size());
  const absl::Status status = ParallelFor(tiles->size(), [&](size_t i) -> absl::Status {
    if (goes_on && !goes_on()) return absl::CancelledError("stopped while looking for the plans of the map's tiles");
    const TileEntry& tile = (*tiles)[i];
    const std::string name = NameOf(map, tile), state = StateOf(tile);
    parts[i] = Find(name, state);
    if (parts[i]) return absl::OkStatus();
    absl::StatusOr<PlanPart> part = StoredPlan(map, tile);
    if (!part.ok()) {
      part = PlanOfTile(map, tile.key);
      if (!part.ok()) return part.status();
      Store(map, tile, *part);
    }
    parts[i] = std::make_shared<const PlanPart>(*std::move(part));
    Keep(name, state, parts[i]);
    return absl::OkStatus();
  });
  if (!status.ok()) return status;
  auto plan = std::make_shared<const WallPlan>(parts);
  const std::lock_guard lock(mutex_);
  newest_state_ = epoch;
  newest_ = plan;
  return plan;
}

size_t PlanCache::bytes() const {
  const std::lock_guard lock(mutex_);
  return bytes_;
}

size_t PlanCache::made() const {
  const std::lock_guard lock(mutex_);
  return made_;
}

size_t PlanCache::not_stored() const {
  const std::lock_guard lock(mutex_);
  return not_stored_;
}

std::shared_ptr<const PlanPart> PlanCache::Find(const std::string& tile, const std::string& state) {
  const std::lock_guard lock(mutex_);
  const auto found = parts_.find(tile);
  if (found == parts_.end() || found->second.state != state) return nullptr;
  used_.splice(used_.begin(), used_, found->second.use);
  return found->second.part;
}

void PlanCache::Keep(const std::string& tile, const std::string& state, std::shared_ptr<const PlanPart> part) {
  const std::lock_guard lock(mutex_);
  Drop(tile);
  bytes_ += BytesOf(*part, tile);
  used_.push_front(tile);
  parts_.emplace(tile, Entry{state, std::move(part), used_.begin()});
  while (bytes_ > most_bytes_ && used_.size() > 1) Drop(std::string(used_.back()));
}

// With the mutex held.
void PlanCache::Drop(const std::string& tile) {
  const auto found = parts_.find(tile);
  if (found == parts_.end()) return;
  bytes_ -= BytesOf(*found->second.part, tile);
  used_.erase(found->second.use);
  parts_.erase(found);
}

}  // namespace mapkeep
