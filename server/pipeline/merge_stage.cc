#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <memory>
#include <numeric>
#include <utility>

#include "core/dor/exposure.h"
#include "core/ratio_map/forgetting.h"
#include "core/ratio_map/merge.h"
#include "core/ratio_map/remnants.h"
#include "server/pipeline/parallel.h"
#include "server/pipeline/stages.h"

namespace mapkeep {
namespace {

using BlockPointer = std::shared_ptr<const Block>;

// Blocks by key, for lookups from several threads.
struct BlockTable {
  std::vector<BlockKey> keys;        // sorted
  std::vector<BlockPointer> blocks;  // nullptr: the map has none there

  const Block* Find(BlockKey key) const {
    const auto found = std::ranges::lower_bound(keys, key);
    return found != keys.end() && *found == key ? blocks[found - keys.begin()].get() : nullptr;
  }
};

absl::StatusOr<BlockTable> ReadTable(const Snapshot& snapshot, std::vector<BlockKey> keys) {
  BlockTable table{.keys = std::move(keys)};
  table.blocks.resize(table.keys.size());
  const absl::Status status = ParallelFor(table.keys.size(), [&](size_t i) -> absl::Status {
    auto block = snapshot.Read(table.keys[i]);
    if (!block.ok()) return block.status();
    table.blocks[i] = *std::move(block);
    return absl::OkStatus();
  });
  if (!status.ok()) return status;
  return table;
}

// The keys and those of their neighbours, sorted, none twice.
std::vector<BlockKey> WithNeighbours(std::span<const BlockKey> keys) {
  std::vector<BlockKey> grown;
  grown.reserve(27 * keys.size());
  for (const BlockKey key : keys) {
    for (const VoxelIndex& block : NeighbourhoodOf(BlockIndexOf(key))) {
      if (InRange({block.x * kBlockSize, block.y * kBlockSize, block.z * kBlockSize})) {
        grown.push_back(BlockKeyOf(block));
      }
    }
  }
  std::ranges::sort(grown);
  grown.erase(std::ranges::unique(grown).begin(), grown.end());
  return grown;
}

// Voxels within the session's reach that the head has and neither the base nor the session knows: a commit that came
// between made them.
absl::StatusOr<std::vector<VoxelKey>> GainedVoxels(const Snapshot& head, const MergeInput& input) {
  std::vector<VoxelKey> gained;
  if (head.epoch() == input.base.epoch()) return gained;
  const auto keys = BlocksWithin(head, input.reach);
  if (!keys.ok()) return keys.status();
  for (const BlockKey key : *keys) {
    const auto now = head.Read(key);
    if (!now.ok()) return now.status();
    const auto then = input.base.Read(key);
    if (!then.ok()) return then.status();
    for (const Voxel& voxel : (*now)->voxels) {
      const VoxelKey of = VoxelKeyOf(key, voxel.position);
      if (*then != nullptr && FindVoxel(**then, voxel.position) != nullptr) continue;
      if (std::ranges::binary_search(input.session.voxels, of, {}, &SessionVoxel::key)) continue;
      gained.push_back(of);
    }
  }
  return gained;
}

// The session's voxels with the exposures of the gained ones.
absl::StatusOr<std::vector<SessionVoxel>> CountedAgain(const std::vector<VoxelKey>& gained, const MergeInput& input) {
  const auto evidence = CountEvidence(input.scans, input.poses, input.session.voxel_size, gained, {}, input.exposure);
  if (!evidence.ok()) return evidence.status();
  std::vector<SessionVoxel> voxels = input.session.voxels;
  for (const VoxelKey key : gained) {
    const auto found = std::ranges::lower_bound(evidence->keys, key);
    if (found == evidence->keys.end() || *found != key) continue;
    const uint32_t exposures = evidence->exposures[found - evidence->keys.begin()];
    if (exposures > 0) voxels.push_back({.key = key, .exposures = exposures});
  }
  std::ranges::sort(voxels, {}, &SessionVoxel::key);
  return voxels;
}

// One touched block: its key and the session's voxels in it.
struct Touch {
  BlockKey key{};
  std::span<const SessionVoxel> voxels;
};

std::vector<Touch> ByBlock(std::span<const SessionVoxel> voxels) {
  std::vector<Touch> touched;
  for (size_t begin = 0; begin < voxels.size();) {
    const BlockKey key = BlockKeyOf(voxels[begin].key);
    size_t end = begin;
    while (end < voxels.size() && BlockKeyOf(voxels[end].key) == key) ++end;
    touched.push_back({key, voxels.subspan(begin, end - begin)});
    begin = end;
  }
  return touched;
}

// Calls visit(i, key) for the block and its neighbours inside the range, in the order of NeighbourhoodOf.
template <typename Visit>
void ForEachAround(BlockKey block, const Visit& visit) {
  const auto neighbours = NeighbourhoodOf(BlockIndexOf(block));
  for (size_t i = 0; i < neighbours.size(); ++i) {
    const VoxelIndex& n = neighbours[i];
    if (InRange({n.x * kBlockSize, n.y * kBlockSize, n.z * kBlockSize})) visit(i, BlockKeyOf(n));
  }
}

// Calls visit(i, index of the touch) for the block and its neighbours that are touched.
template <typename Visit>
void ForEachTouchAround(std::span<const Touch> touched, BlockKey block, const Visit& visit) {
  ForEachAround(block, [&](size_t i, BlockKey key) {
    const auto found = std::ranges::lower_bound(touched, key, {}, &Touch::key);
    if (found != touched.end() && found->key == key) visit(i, static_cast<size_t>(found - touched.begin()));
  });
}

BlockNeighbourhood BlocksAround(const BlockTable& table, BlockKey block) {
  BlockNeighbourhood around{};
  ForEachAround(block, [&](size_t i, BlockKey key) { around[i] = table.Find(key); });
  return around;
}

SessionNeighbourhood SessionAround(std::span<const Touch> touched, BlockKey block) {
  SessionNeighbourhood around;
  ForEachTouchAround(touched, block, [&](size_t i, size_t at) { around[i] = touched[at].voxels; });
  return around;
}

// What the session says has left each touched block, in their order.
std::vector<Departed> DepartedFromAll(const BlockTable& table, std::span<const Touch> touched, double voxel_size,
                                      const MergeParameters& parameters) {
  std::vector<Departed> departed(touched.size());
  tbb::parallel_for(size_t{0}, touched.size(), [&](size_t i) {
    departed[i] = DepartedFrom(BlocksAround(table, touched[i].key), SessionAround(touched, touched[i].key), voxel_size,
                               parameters);
  });
  return departed;
}

// A touched block of the map as eq. 9 may take it.
Block RememberedOf(const BlockTable& table, std::span<const Touch> touched, std::span<const Departed> departed,
                   const Touch& touch) {
  const Block* const old = table.Find(touch.key);
  if (old == nullptr) return {.key = touch.key};
  std::array<const Departed*, 27> around{};
  ForEachTouchAround(touched, touch.key, [&](size_t n, size_t at) { around[n] = &departed[at]; });
  return Remembered(*old, around, touch.voxels);
}

// What the session has to say of a touched block, without what is left in it of what moved.
std::vector<SessionVoxel> News(const BlockTable& table, std::span<const Touch> touched, const Touch& touch,
                               const MergeParameters& parameters) {
  const std::vector<uint16_t> remnants =
      RemnantsIn(BlocksAround(table, touch.key), SessionAround(touched, touch.key), parameters);
  std::vector<SessionVoxel> news(touch.voxels.begin(), touch.voxels.end());
  std::erase_if(news, [&](const SessionVoxel& voxel) {
    return std::ranges::binary_search(remnants, PositionInBlock(voxel.key));
  });
  return news;
}

// The block with its verdicts renewed.
Block Filtered(const BlockTable& table, const Block& block, const MapFilterParameters& parameters) {
  const std::vector<MapVerdict> verdicts = FilterBlock(BlocksAround(table, block.key), parameters);
  Block filtered = block;
  for (size_t i = 0; i < verdicts.size(); ++i) {
    filtered.voxels[i].is_static = verdicts[i] == MapVerdict::kStatic;
    filtered.voxels[i].is_new = verdicts[i] == MapVerdict::kNew;
  }
  return filtered;
}

}  // namespace

absl::StatusOr<MergeResult> MergeIntoMap(const Snapshot& head, const MergeInput& input, const MergeParameters& merge,
                                         MapFilterParameters filter, const Progress& progress) {
  filter.voxel_size = input.session.voxel_size;
  const auto gained = GainedVoxels(head, input);
  if (!gained.ok()) return gained.status();
  std::vector<SessionVoxel> recounted;
  if (!gained->empty()) {
    auto voxels = CountedAgain(*gained, input);
    if (!voxels.ok()) return voxels.status();
    recounted = *std::move(voxels);
  }
  const std::vector<Touch> touched = ByBlock(gained->empty() ? input.session.voxels : recounted);
  std::vector<BlockKey> touched_keys;
  for (const Touch& touch : touched) touched_keys.push_back(touch.key);

  // The filter's verdict on a block needs its neighbours, and the verdicts of the touched blocks' neighbours change.
  const std::vector<BlockKey> affected = WithNeighbours(touched_keys);
  auto table = ReadTable(head, WithNeighbours(affected));
  if (!table.ok()) return table.status();
  const BlockTable before = *table;
  if (progress && !progress(0.2)) return absl::CancelledError("stopped before the merge");

  const std::vector<Departed> departed = DepartedFromAll(before, touched, input.session.voxel_size, merge);
  std::vector<Block> merged(touched.size());
  const absl::Status merging = ParallelFor(touched.size(), [&](size_t i) {
    const Block old = RememberedOf(before, touched, departed, touched[i]);
    merged[i] = MergeBlock(old, News(before, touched, touched[i], merge), input.session, merge);
    return absl::OkStatus();
  });
  if (!merging.ok()) return merging;
  for (Block& block : merged) {
    const auto at = std::ranges::lower_bound(table->keys, block.key) - table->keys.begin();
    const bool absent = before.blocks[at] == nullptr && block.voxels.empty();
    table->blocks[at] = absent ? nullptr : std::make_shared<const Block>(std::move(block));
  }
  if (progress && !progress(0.5)) return absl::CancelledError("stopped before the map filter");

  std::vector<Block> filtered(affected.size());
  std::vector<char> changed(affected.size());
  const absl::Status filtering = ParallelFor(affected.size(), [&](size_t i) {
    const Block* now = table->Find(affected[i]);
    if (now == nullptr) return absl::OkStatus();
    filtered[i] = Filtered(*table, *now, filter);
    const Block* old = before.Find(affected[i]);
    changed[i] = old == nullptr || *old != filtered[i];
    return absl::OkStatus();
  });
  if (!filtering.ok()) return filtering;

  MergeResult result;
  for (size_t i = 0; i < affected.size(); ++i) {
    if (std::ranges::binary_search(touched_keys, affected[i])) {
      result.voxels += filtered[i].voxels.size();
      result.static_voxels += std::ranges::count_if(filtered[i].voxels, &Voxel::is_static);
    }
    if (changed[i]) result.changed.push_back(std::move(filtered[i]));
  }
  if (progress && !progress(0.8)) return absl::CancelledError("stopped before the commit");
  return result;
}

}  // namespace mapkeep
