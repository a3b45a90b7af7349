#include "core/voxels/voxel_grid.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace mapkeep {
namespace {

constexpr uint64_t kFree = ~uint64_t{0};

// 21 bits an axis: enough for grids of sub-voxels as well.
uint64_t PackBlock(int32_t x, int32_t y, int32_t z) {
  const auto low = [](int32_t c) { return static_cast<uint64_t>(c) & 0x1fffff; };
  return low(x) | low(y) << 21 | low(z) << 42;
}

VoxelIndex UnpackBlock(uint64_t key) {
  const auto axis = [&](int shift) { return static_cast<int32_t>(static_cast<int64_t>(key << (43 - shift)) >> 43); };
  return {axis(0), axis(21), axis(42)};
}

// Fibonacci hashing: the high bits of the product are well mixed.
size_t HashOf(uint64_t key, size_t mask) { return (key * 0x9e3779b97f4a7c15U >> 24) & mask; }

}  // namespace

VoxelGrid::VoxelGrid() : slot_keys_(1024, kFree), slot_blocks_(1024) {}

size_t VoxelGrid::SlotOf(uint64_t key) const {
  const size_t mask = slot_keys_.size() - 1;
  size_t slot = HashOf(key, mask);
  while (slot_keys_[slot] != key && slot_keys_[slot] != kFree) slot = (slot + 1) & mask;
  return slot;
}

int32_t VoxelGrid::FindBlock(int32_t x, int32_t y, int32_t z) const {
  const uint64_t key = PackBlock(x, y, z);
  const size_t slot = SlotOf(key);
  return slot_keys_[slot] == key ? slot_blocks_[slot] : kNoBrick;
}

void VoxelGrid::Grow() {
  slot_keys_.assign(slot_keys_.size() * 2, kFree);
  slot_blocks_.resize(slot_keys_.size());
  for (size_t block = 0; block < block_keys_.size(); ++block) {
    const size_t slot = SlotOf(block_keys_[block]);
    slot_keys_[slot] = block_keys_[block];
    slot_blocks_[slot] = static_cast<int32_t>(block);
  }
}

int32_t VoxelGrid::FindOrAddBrick(int32_t x, int32_t y, int32_t z) {
  const uint64_t key = PackBlock(x >> kBlockInBricksBits, y >> kBlockInBricksBits, z >> kBlockInBricksBits);
  size_t slot = SlotOf(key);
  if (slot_keys_[slot] == kFree) {
    if (2 * (block_keys_.size() + 1) > slot_keys_.size()) {
      Grow();
      slot = SlotOf(key);
    }
    slot_keys_[slot] = key;
    slot_blocks_[slot] = static_cast<int32_t>(block_keys_.size());
    block_keys_.push_back(key);
    children_.emplace_back().fill(kNoBrick);
  }
  int32_t& brick = children_[slot_blocks_[slot]][ChildOf(x, y, z)];
  if (brick == kNoBrick) {
    brick = static_cast<int32_t>(bits_.size());
    bits_.emplace_back().fill(0);
    corners_.push_back({x * kBrickSize, y * kBrickSize, z * kBrickSize});
  }
  return brick;
}

bool VoxelGrid::Insert(const VoxelIndex& voxel) {
  const VoxelIndex corner{voxel.x & -kBrickSize, voxel.y & -kBrickSize, voxel.z & -kBrickSize};
  if (last_brick_ == kNoBrick || corners_[last_brick_] != corner) {
    last_brick_ = FindOrAddBrick(voxel.x >> kBrickBits, voxel.y >> kBrickBits, voxel.z >> kBrickBits);
  }
  uint64_t& layer = bits_[last_brick_][LayerInBrick(voxel.z)];
  const uint64_t bit = BitInLayer(voxel.x, voxel.y);
  const bool is_new = (layer & bit) == 0;
  layer |= bit;
  return is_new;
}

void VoxelGrid::Merge(const VoxelGrid& other) {
  for (size_t i = 0; i < other.bits_.size(); ++i) {
    const VoxelIndex& corner = other.corners_[i];
    const int32_t brick = FindOrAddBrick(corner.x >> kBrickBits, corner.y >> kBrickBits, corner.z >> kBrickBits);
    for (int layer = 0; layer < kBrickSize; ++layer) bits_[brick][layer] |= other.bits_[i][layer];
  }
}

void VoxelGrid::Clear() {
  std::ranges::fill(slot_keys_, kFree);
  block_keys_.clear();
  children_.clear();
  bits_.clear();
  corners_.clear();
  ranks_.clear();
  blocks_.clear();
  size_ = 0;
  last_brick_ = kNoBrick;
}

void VoxelGrid::Finish() {
  std::vector<std::pair<BlockKey, int32_t>> blocks(block_keys_.size());
  for (size_t i = 0; i < blocks.size(); ++i) blocks[i] = {BlockKeyOf(UnpackBlock(block_keys_[i])), i};
  std::ranges::sort(blocks);

  std::vector<BrickBits> bits;
  std::vector<VoxelIndex> corners;
  bits.reserve(bits_.size());
  corners.reserve(bits_.size());
  ranks_.reserve(bits_.size());
  uint32_t id = 0;
  for (const auto& [key, block] : blocks) {
    const VoxelIndex at = BlockIndexOf(key);
    const auto first = static_cast<int32_t>(bits.size());
    for (int32_t& child : children_[block]) {
      if (child == kNoBrick) continue;
      Ranks ranks{.first = id};
      uint16_t before = 0;
      for (int layer = 0; layer < kBrickSize; ++layer) {
        ranks.before[layer] = before;
        before += static_cast<uint16_t>(std::popcount(bits_[child][layer]));
      }
      id += before;
      bits.push_back(bits_[child]);
      corners.push_back(corners_[child]);
      ranks_.push_back(ranks);
      child = static_cast<int32_t>(bits.size()) - 1;
    }
    blocks_.push_back(
        {{at.x * kBlockSize, at.y * kBlockSize, at.z * kBlockSize}, first, static_cast<int32_t>(bits.size())});
  }
  bits_ = std::move(bits);
  corners_ = std::move(corners);
  size_ = id;
}

void VoxelGrid::SortByKey(std::vector<VoxelKey>& keys, std::vector<uint32_t>& ids) const {
  std::vector<std::pair<VoxelKey, uint32_t>> order;
  order.reserve(size_);
  // Ids are already grouped by block: sorting one block at a time is enough.
  BlockKey block{};
  auto sort_tail = [&, begin = size_t{0}]() mutable {
    std::sort(order.begin() + static_cast<ptrdiff_t>(begin), order.end());
    begin = order.size();
  };
  for (size_t brick = 0; brick < bits_.size(); ++brick) {
    const BlockKey of = BlockKeyOf(BlockOf(corners_[brick]));
    if (of != block) sort_tail();
    block = of;
    ForEachInBrick(static_cast<int32_t>(brick), [&](uint32_t id, const VoxelIndex& index) {
      order.emplace_back(VoxelKeyOf(of, PositionInBlock(index)), id);
    });
  }
  sort_tail();
  keys.resize(size_);
  ids.resize(size_);
  for (size_t i = 0; i < size_; ++i) std::tie(keys[i], ids[i]) = order[i];
}

}  // namespace mapkeep
