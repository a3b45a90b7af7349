#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "core/voxels/voxel_index.h"

namespace mapkeep {

inline constexpr int kBrickBits = 3;
inline constexpr int32_t kBrickSize = 1 << kBrickBits;  ///< voxels an axis of a brick
inline constexpr int32_t kNoBrick = -1;
inline constexpr uint32_t kNoVoxel = 0xffffffff;

/// Which voxels of an 8x8x8 brick are set: a word a layer, bit x + 8 y of word z.
using BrickBits = std::array<uint64_t, kBrickSize>;

constexpr int LayerInBrick(int32_t z) { return z & (kBrickSize - 1); }
constexpr uint64_t BitInLayer(int32_t x, int32_t y) {
  constexpr int32_t kMask = kBrickSize - 1;
  return uint64_t{1} << ((x & kMask) | (y & kMask) << kBrickBits);
}

/// The bricks of a block: [first, end), contiguous.
struct BlockBricks {
  VoxelIndex corner;  ///< the lowest voxel of the block
  int32_t first = 0, end = 0;
};

/// A sparse set of voxels: a hash table of blocks (32^3 voxels), each a table of bricks (8^3), each a bit a voxel. Once
/// finished, every voxel has an index ("id") below size(), dense and independent of the order of insertion, so that
/// statistics live in plain arrays. Reading from several threads at once is safe.
class VoxelGrid {
 public:
  VoxelGrid();

  /// Adds a voxel; true if it was not there. Not after Finish.
  bool Insert(const VoxelIndex& voxel);

  /// Adds all voxels of another grid, finished or not.
  void Merge(const VoxelGrid& other);

  /// Empties the grid and keeps its memory.
  void Clear();

  /// Numbers the voxels: by block key, then brick, then position in the brick.
  void Finish();

  /// The rest is for finished grids.
  size_t size() const { return size_; }

  /// Also before Finish.
  size_t brick_count() const { return bits_.size(); }

  /// The brick at brick coordinates (voxel >> 3), or kNoBrick. Bricks are in the order of ids.
  int32_t FindBrick(int32_t x, int32_t y, int32_t z) const {
    const int32_t block = FindBlock(x >> kBlockInBricksBits, y >> kBlockInBricksBits, z >> kBlockInBricksBits);
    return block == kNoBrick ? kNoBrick : children_[block][ChildOf(x, y, z)];
  }

  /// Whether any voxel of a block (coordinates voxel >> 5) is set: its number, or kNoBrick.
  int32_t FindBlock(int32_t x, int32_t y, int32_t z) const;

  /// The brick at brick coordinates inside a block that FindBlock gave.
  int32_t BrickInBlock(int32_t block, int32_t x, int32_t y, int32_t z) const {
    return children_[block][ChildOf(x, y, z)];
  }

  /// Also before Finish: bricks by number, each with a voxel at least.
  const BrickBits& bits(int32_t brick) const { return bits_[brick]; }

  /// The lowest voxel of a brick. Also before Finish.
  VoxelIndex CornerOfBrick(int32_t brick) const { return corners_[brick]; }

  /// The blocks in the order of their keys.
  const std::vector<BlockBricks>& blocks() const { return blocks_; }

  /// The id of the first voxel of a brick; ids of a brick are contiguous.
  uint32_t FirstId(int32_t brick) const { return ranks_[brick].first; }

  /// The id of a voxel of a brick, which must be set.
  uint32_t IdInBrick(int32_t brick, int layer, uint64_t bit) const {
    return ranks_[brick].first + ranks_[brick].before[layer] +
           static_cast<uint32_t>(std::popcount(bits_[brick][layer] & (bit - 1)));
  }

  /// The id of a voxel, or kNoVoxel.
  uint32_t Find(const VoxelIndex& voxel) const {
    const int32_t brick = FindBrick(voxel.x >> kBrickBits, voxel.y >> kBrickBits, voxel.z >> kBrickBits);
    return brick == kNoBrick ? kNoVoxel : FindInBrick(brick, voxel);
  }

  /// The id of a voxel that lies in the given brick, or kNoVoxel.
  uint32_t FindInBrick(int32_t brick, const VoxelIndex& voxel) const {
    const uint64_t bit = BitInLayer(voxel.x, voxel.y);
    const int layer = LayerInBrick(voxel.z);
    return (bits_[brick][layer] & bit) == 0 ? kNoVoxel : IdInBrick(brick, layer, bit);
  }

  /// Calls visit(id, dx, dy, dz) for the voxels at most `reach` away from `at` an axis, itself included, x fastest.
  template <typename Visit>
  void ForEachWithin(int reach, const VoxelIndex& at, const Visit& visit) const {
    Neighbourhood neighbours(*this, at);
    for (int dz = -reach; dz <= reach; ++dz) {
      for (int dy = -reach; dy <= reach; ++dy) {
        for (int dx = -reach; dx <= reach; ++dx) neighbours.Visit(dx, dy, dz, visit);
      }
    }
  }

  /// The same for those at most `radius` voxel edges away.
  template <typename Visit>
  void ForEachInBall(double radius, const VoxelIndex& at, const Visit& visit) const {
    Neighbourhood neighbours(*this, at);
    const auto reach = static_cast<int>(radius);
    for (int dz = -reach; dz <= reach; ++dz) {
      for (int dy = -reach; dy <= reach; ++dy) {
        const double rest = radius * radius - dy * dy - dz * dz;
        if (rest < 0) continue;
        const auto half = static_cast<int>(std::sqrt(rest));
        for (int dx = -half; dx <= half; ++dx) neighbours.Visit(dx, dy, dz, visit);
      }
    }
  }

  /// Calls visit(id, index) for every voxel of a brick, ids rising.
  template <typename Visit>
  void ForEachInBrick(int32_t brick, const Visit& visit) const {
    const VoxelIndex corner = corners_[brick];
    uint32_t id = ranks_[brick].first;
    for (int layer = 0; layer < kBrickSize; ++layer) {
      for (uint64_t rest = bits_[brick][layer]; rest != 0; rest &= rest - 1) {
        const int bit = std::countr_zero(rest);
        visit(id++, VoxelIndex{corner.x + (bit & 7), corner.y + (bit >> 3), corner.z + layer});
      }
    }
  }

  /// The ids of all voxels in the order of their keys, and the keys.
  void SortByKey(std::vector<VoxelKey>& keys, std::vector<uint32_t>& ids) const;

 private:
  static constexpr int kBlockInBricksBits = kBlockBits - kBrickBits;
  static constexpr int kBricksOfBlock = 1 << (3 * kBlockInBricksBits);

  struct Ranks {
    uint32_t first = 0;                         // id of the brick's first voxel
    std::array<uint16_t, kBrickSize> before{};  // voxels in the layers below
  };

  // Voxels around one, looked up with one look a brick as long as the next lies in the same.
  class Neighbourhood {
   public:
    Neighbourhood(const VoxelGrid& grid, const VoxelIndex& at) : grid_(grid), at_(at) {}

    template <typename Visitor>
    void Visit(int dx, int dy, int dz, const Visitor& visit) {
      const VoxelIndex voxel{at_.x + dx, at_.y + dy, at_.z + dz};
      const VoxelIndex in{voxel.x >> kBrickBits, voxel.y >> kBrickBits, voxel.z >> kBrickBits};
      if (!known_ || in != brick_at_) {
        brick_ = grid_.FindBrick(in.x, in.y, in.z);
        brick_at_ = in;
        known_ = true;
      }
      const uint32_t id = brick_ == kNoBrick ? kNoVoxel : grid_.FindInBrick(brick_, voxel);
      if (id != kNoVoxel) visit(id, dx, dy, dz);
    }

   private:
    const VoxelGrid& grid_;
    const VoxelIndex at_;
    VoxelIndex brick_at_;
    int32_t brick_ = kNoBrick;
    bool known_ = false;
  };

  static int ChildOf(int32_t x, int32_t y, int32_t z) {
    constexpr int32_t kMask = (1 << kBlockInBricksBits) - 1;
    return (x & kMask) | (y & kMask) << kBlockInBricksBits | (z & kMask) << (2 * kBlockInBricksBits);
  }

  int32_t FindOrAddBrick(int32_t x, int32_t y, int32_t z);
  size_t SlotOf(uint64_t key) const;
  void Grow();

  std::vector<uint64_t> slot_keys_;   // open addressing, a power of two; kFree or a block's packed coordinates
  std::vector<int32_t> slot_blocks_;  // the block's number
  std::vector<uint64_t> block_keys_;
  std::vector<std::array<int32_t, kBricksOfBlock>> children_;  // a block: its bricks
  std::vector<BrickBits> bits_;                                // a brick
  std::vector<VoxelIndex> corners_;
  std::vector<Ranks> ranks_;
  std::vector<BlockBricks> blocks_;
  size_t size_ = 0;
  int32_t last_brick_ = kNoBrick;  // Insert goes on where it was
};

}  // namespace mapkeep
