#include "core/ratio_map/contradiction.h"

#include <algorithm>

#include "core/ratio_map/neighbourhood.h"

namespace mapkeep {
namespace {

constexpr int kMinContradicted = 3;  // voxels

enum class Said : uint8_t {
  kNothing,       // there is nothing, or ground
  kLittle,        // in the map, and neither met nor contradicted
  kContradicted,  // in the map, and contradicted
  kMet,           // hit in this session
};

// What the session said about the voxels of the centre block and `margin` voxels around it.
class Neighbourhood {
 public:
  Neighbourhood(const BlockNeighbourhood& map, const SessionNeighbourhood& session, int margin,
                const MergeParameters& parameters)
      : said_(margin) {
    for (int i = 0; i < 27; ++i) {
      if (map[i] != nullptr) {
        for (const Voxel& voxel : map[i]->voxels) {
          if (!voxel.ground) Set(IndexIn(voxel.position, i), Said::kLittle);
        }
      }
      for (const SessionVoxel& voxel : session[i]) {
        const VoxelIndex at = IndexIn(PositionInBlock(voxel.key), i);
        if (voxel.ground && voxel.hits > 0) {
          Set(at, Said::kNothing);
        } else if (IsContradicted(voxel, parameters)) {
          if (said_.Has(at) && said_[at] == Said::kLittle) said_[at] = Said::kContradicted;
        } else if (voxel.hits > 0 || voxel.was_removed) {
          Set(at, Said::kMet);
        }
      }
    }
  }

  Said Of(const VoxelIndex& at) const { return said_[at]; }

 private:
  void Set(const VoxelIndex& at, Said said) {
    if (said_.Has(at)) said_[at] = said;
  }

  ValuesAround<Said> said_;
};

}  // namespace

std::vector<uint16_t> ForgottenWithOthers(const BlockNeighbourhood& map, const SessionNeighbourhood& session,
                                          double voxel_size, const MergeParameters& parameters) {
  const bool contradicts = std::ranges::any_of(session, [&](std::span<const SessionVoxel> voxels) {
    return std::ranges::any_of(voxels, [&](const SessionVoxel& voxel) { return IsContradicted(voxel, parameters); });
  });
  if (!contradicts || parameters.contradicted_share > 1 || map[kCentre] == nullptr) return {};
  constexpr double kMinReach = 2.3;  // voxel edges
  const double reach =
      std::clamp(parameters.contradiction_reach / voxel_size, kMinReach, static_cast<double>(kBlockSize));
  const auto margin = static_cast<int>(reach);
  const Neighbourhood around(map, session, margin, parameters);
  std::vector<uint16_t> forgotten;
  for (const Voxel& voxel : map[kCentre]->voxels) {
    const VoxelIndex at = IndexIn(voxel.position);
    if (around.Of(at) != Said::kLittle) continue;
    int all = 0, contradicted = 0;
    for (int dz = -margin; dz <= margin; ++dz) {
      for (int dy = -margin; dy <= margin; ++dy) {
        for (int dx = -margin; dx <= margin; ++dx) {
          if (dx * dx + dy * dy + dz * dz > reach * reach || (dx == 0 && dy == 0 && dz == 0)) continue;
          const Said said = around.Of({at.x + dx, at.y + dy, at.z + dz});
          all += said != Said::kNothing;
          contradicted += said == Said::kContradicted;
        }
      }
    }
    if (contradicted >= kMinContradicted && contradicted >= parameters.contradicted_share * all) {
      forgotten.push_back(voxel.position);
    }
  }
  return forgotten;
}

}  // namespace mapkeep
