#include "core/ratio_map/forgetting.h"

#include <algorithm>
#include <iterator>

#include "core/ratio_map/cohorts.h"
#include "core/ratio_map/neighbourhood.h"

namespace mapkeep {
namespace {

// Of the 26 voxels around one: fewer are leaves and edges that a few rays missed.
constexpr int kMinBeside = 5;

std::vector<uint16_t> Contradicted(const Block& block, std::span<const SessionVoxel> session,
                                   const MergeParameters& parameters) {
  std::vector<uint16_t> contradicted;
  for (const SessionVoxel& voxel : session) {
    if (!IsContradicted(voxel, parameters)) continue;
    const Voxel* const old = FindVoxel(block, PositionInBlock(voxel.key));
    if (old != nullptr && !old->ground) contradicted.push_back(old->position);
  }
  return contradicted;
}

}  // namespace

Departed DepartedFrom(const BlockNeighbourhood& map, const SessionNeighbourhood& session, double voxel_size,
                      const MergeParameters& parameters) {
  if (map[kCentre] == nullptr) return {};
  const std::vector<uint16_t> others = ForgottenWithOthers(map, session, voxel_size, parameters),
                              cohort = ForgottenWithCohort(map, session, voxel_size, parameters);
  Departed departed;
  std::ranges::set_union(others, cohort, std::back_inserter(departed.forgotten));
  departed.contradicted = Contradicted(*map[kCentre], session[kCentre], parameters);
  return departed;
}

Block Remembered(const Block& block, const std::array<const Departed*, 27>& departed,
                 std::span<const SessionVoxel> session) {
  Block remembered = block;
  if (departed[kCentre] != nullptr) {
    std::erase_if(remembered.voxels, [&](const Voxel& voxel) {
      return std::ranges::binary_search(departed[kCentre]->forgotten, voxel.position);
    });
  }
  const bool any = std::ranges::any_of(departed, [](const Departed* of) {
    return of != nullptr && !(of->forgotten.empty() && of->contradicted.empty());
  });
  if (!any) return remembered;
  ValuesAround<uint8_t> left(1);
  for (int i = 0; i < 27; ++i) {
    if (departed[i] == nullptr) continue;
    for (const auto* positions : {&departed[i]->forgotten, &departed[i]->contradicted}) {
      for (const uint16_t position : *positions) {
        if (const VoxelIndex at = IndexIn(position, i); left.Has(at)) left[at] = 1;
      }
    }
  }
  auto next = session.begin();
  for (Voxel& voxel : remembered.voxels) {
    while (next != session.end() && PositionInBlock(next->key) < voxel.position) ++next;
    const bool met = next != session.end() && PositionInBlock(next->key) == voxel.position && next->hits > 0;
    if (!met) continue;
    int beside = 0;
    ForEachBeside(IndexIn(voxel.position), 1, [&](const VoxelIndex& at) { beside += left[at]; });
    if (beside >= kMinBeside) voxel.mask = 0;
  }
  return remembered;
}

}  // namespace mapkeep
