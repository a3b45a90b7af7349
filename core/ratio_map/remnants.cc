#include "core/ratio_map/remnants.h"

#include <algorithm>
#include <span>

#include "core/ratio_map/neighbourhood.h"

namespace mapkeep {
namespace {

constexpr int kFollowed = 12;  // voxels around the block as far as things are followed
constexpr int kGap = 2;        // voxels an axis, from one to the next of a thing

// What the map and the session say of a voxel.
enum Said : uint8_t {
  kNothing,
  kInMap = 1,
  kStandsInMap = 2,  // and is no ground
  kWasRemoved = 4,
};

class NewThings {
 public:
  NewThings(const BlockNeighbourhood& map, const SessionNeighbourhood& session)
      : said_(kFollowed + 1), things_(kFollowed, kNone) {
    ForEachWithin(map, kFollowed + 1, [&](const Voxel& voxel, const VoxelIndex& at, bool) {
      said_[at] = voxel.ground ? kInMap : kInMap | kStandsInMap;
    });
    ForEachIn(session, [&](const SessionVoxel& voxel, const VoxelIndex& at) {
      if (voxel.was_removed && said_.Has(at)) said_[at] |= kWasRemoved;
    });
    std::vector<VoxelIndex> open;
    ForEachIn(session, [&](const SessionVoxel& voxel, const VoxelIndex& at) {
      if (voxel.hits == 0 || voxel.ground || !things_.Has(at) || (said_[at] & kInMap) != 0) return;
      if (Touches(at, kStandsInMap)) return;
      things_[at] = kUnknown;
      open.push_back(at);
    });
    for (const VoxelIndex& at : open) {
      if (things_[at] == kUnknown) Follow(at);
    }
  }

  // Of the thing that the voxel belongs to, the share that touches what was removed; 0 if it belongs to none.
  double ShareBesideRemoved(const VoxelIndex& at) const { return things_[at] == kNone ? 0 : shares_[things_[at]]; }

 private:
  static constexpr int32_t kNone = -1, kUnknown = -2;

  template <typename Visit>
  static void ForEachIn(const SessionNeighbourhood& session, const Visit& visit) {
    for (int i = 0; i < 27; ++i) {
      for (const SessionVoxel& voxel : session[i]) visit(voxel, IndexIn(PositionInBlock(voxel.key), i));
    }
  }

  bool Touches(const VoxelIndex& at, Said what) const {
    bool touches = false;
    ForEachBeside(at, 1, [&](const VoxelIndex& beside) { touches = touches || (said_[beside] & what) != 0; });
    return touches;
  }

  void Follow(const VoxelIndex& start) {
    const auto thing = static_cast<int32_t>(shares_.size());
    std::vector<VoxelIndex> reached = {start};
    things_[start] = thing;
    size_t beside_removed = 0;
    for (size_t i = 0; i < reached.size(); ++i) {
      const VoxelIndex at = reached[i];
      beside_removed += Touches(at, kWasRemoved) ? 1 : 0;
      ForEachBeside(at, kGap, [&](const VoxelIndex& beside) {
        if (!things_.Has(beside) || things_[beside] != kUnknown) return;
        things_[beside] = thing;
        reached.push_back(beside);
      });
    }
    shares_.push_back(static_cast<double>(beside_removed) / static_cast<double>(reached.size()));
  }

  ValuesAround<uint8_t> said_;
  ValuesAround<int32_t> things_;
  std::vector<double> shares_;  // of each thing
};

}  // namespace

std::vector<uint16_t> RemnantsIn(const BlockNeighbourhood& map, const SessionNeighbourhood& session,
                                 const MergeParameters& parameters) {
  if (map[kCentre] == nullptr || parameters.remnant_share >= 1) return {};
  const auto may_be = [&](const SessionVoxel& voxel) {
    return voxel.hits > 0 && !voxel.ground && FindVoxel(*map[kCentre], PositionInBlock(voxel.key)) == nullptr;
  };
  const bool any_removed = std::ranges::any_of(session, [](std::span<const SessionVoxel> voxels) {
    return std::ranges::any_of(voxels, &SessionVoxel::was_removed);
  });
  if (!any_removed || std::ranges::none_of(session[kCentre], may_be)) return {};
  const NewThings things(map, session);
  std::vector<uint16_t> remnants;
  for (const SessionVoxel& voxel : session[kCentre]) {
    const uint16_t position = PositionInBlock(voxel.key);
    if (things.ShareBesideRemoved(IndexIn(position)) > parameters.remnant_share) remnants.push_back(position);
  }
  return remnants;
}

}  // namespace mapkeep
