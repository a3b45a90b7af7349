#include "core/changes/changed_objects.h"

#include <absl/container/flat_hash_map.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace mapkeep {
namespace {

constexpr double kEnoughHits = 8;  // a few voxels that were hit often say nothing about the others
constexpr int kEnoughKnown = 10;   // voxels of a side

/// One changed voxel on its way into an object.
struct Member {
  VoxelKey key{};
  ChangeClass change = ChangeClass::kAppeared;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  uint16_t hits = 0;  // as stored
};

/// Disjoint sets of members.
class Groups {
 public:
  explicit Groups(size_t count) : parents_(count) {
    for (uint32_t i = 0; i < count; ++i) parents_[i] = i;
  }
  uint32_t Of(uint32_t i) {
    for (; parents_[i] != i; i = parents_[i]) parents_[i] = parents_[parents_[i]];
    return i;
  }
  /// The lower one leads, so that the order of joins does not show.
  void Join(uint32_t a, uint32_t b) {
    a = Of(a);
    b = Of(b);
    parents_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<uint32_t> parents_;
};

/// What appeared stays apart from what went: a car that came stands beside one that left.
bool BelongTogether(ChangeClass a, ChangeClass b) {
  return (a == ChangeClass::kAppeared) == (b == ChangeClass::kAppeared);
}

VoxelIndex Shifted(const VoxelIndex& voxel, int x, int y, int z) { return {voxel.x + x, voxel.y + y, voxel.z + z}; }

const Voxel* Find(const VoxelLookup& state, const VoxelIndex& at) {
  return InRange(at) ? state(VoxelKeyOf(at)) : nullptr;
}

std::vector<Member> MembersOf(std::span<const BlockChange> changes, double voxel_size) {
  std::vector<Member> members;
  const auto add = [&](const Block& block, ChangeClass change) {
    for (const Voxel& voxel : block.voxels) {
      if (voxel.ground) continue;
      members.push_back({VoxelKeyOf(block.key, voxel.position), change, MeanOf(block, voxel, voxel_size), voxel.hits});
    }
  };
  for (const BlockChange& change : changes) {
    add(change.appeared, ChangeClass::kAppeared);
    add(change.disappeared, ChangeClass::kDisappeared);
    add(change.unstable, ChangeClass::kUnstable);
  }
  std::ranges::sort(members, {}, &Member::key);
  return members;
}

class Finder {
 public:
  Finder(std::vector<Member> members, const VoxelLookup& before, const VoxelLookup& after, double voxel_size,
         const ChangedObjectParameters& parameters)
      : members_(std::move(members)), before_(before), after_(after), voxel_size_(voxel_size), parameters_(parameters) {
    by_key_.reserve(members_.size());
    for (uint32_t i = 0; i < members_.size(); ++i) by_key_.emplace(members_[i].key, i);
  }

  std::vector<ChangedObject> Run() {
    Groups groups(members_.size());
    const int reach = std::max(1, static_cast<int>(std::floor(parameters_.gap / voxel_size_ + 1e-9)));
    for (uint32_t i = 0; i < members_.size(); ++i) {
      ForEachAround(VoxelIndexOf(members_[i].key), reach, [&](const VoxelIndex& at) {
        const auto found = by_key_.find(VoxelKeyOf(at));
        if (found != by_key_.end() && BelongTogether(members_[i].change, members_[found->second].change)) {
          groups.Join(i, found->second);
        }
      });
    }
    absl::flat_hash_map<uint32_t, std::vector<uint32_t>> lists;
    for (uint32_t i = 0; i < members_.size(); ++i) lists[groups.Of(i)].push_back(i);
    std::vector<std::pair<uint32_t, ChangedObject>> found;
    for (const auto& [leader, list] : lists) {
      ChangedObject object = Describe(list);
      if (IsObject(object, list)) found.emplace_back(leader, object);
    }
    std::ranges::sort(found, [](const auto& a, const auto& b) {
      return a.second.voxels != b.second.voxels ? a.second.voxels > b.second.voxels : a.first < b.first;
    });
    std::vector<ChangedObject> objects;
    for (auto& [leader, object] : found) objects.push_back(object);
    return objects;
  }

 private:
  template <typename Visit>
  static void ForEachAround(const VoxelIndex& centre, int reach, const Visit& visit) {
    for (int z = -reach; z <= reach; ++z) {
      for (int y = -reach; y <= reach; ++y) {
        for (int x = -reach; x <= reach; ++x) {
          const VoxelIndex at = Shifted(centre, x, y, z);
          if (InRange(at)) visit(at);
        }
      }
    }
  }

  ChangedObject Describe(const std::vector<uint32_t>& list) const {
    ChangedObject object;
    object.voxels = list.size();
    std::array<uint64_t, 3> counts{};
    for (const uint32_t i : list) {
      ++counts[static_cast<size_t>(members_[i].change)];
      const VoxelIndex at = VoxelIndexOf(members_[i].key);
      object.box.extend(CornerOf(at, voxel_size_));
      object.box.extend(CornerOf(Shifted(at, 1, 1, 1), voxel_size_));
      object.centre += members_[i].mean;
    }
    object.centre /= static_cast<double>(list.size());
    for (const uint32_t i : list) object.hits += std::min<double>(HitsOf(members_[i]), kEnoughHits);
    object.hits /= static_cast<double>(list.size());
    object.change = static_cast<ChangeClass>(std::ranges::max_element(counts) - counts.begin());
    return object;
  }

  /// Scans. Of what is unstable: before it was contradicted.
  double HitsOf(const Member& member) const {
    const Voxel* then = member.change == ChangeClass::kUnstable ? before_(member.key) : nullptr;
    return static_cast<double>(then != nullptr ? then->hits : member.hits) / kCountScale;
  }

  bool IsObject(ChangedObject& object, const std::vector<uint32_t>& list) const {
    const auto count = static_cast<double>(list.size());
    if (count * voxel_size_ * voxel_size_ < parameters_.least_area) return false;
    if (object.box.sizes().z() < parameters_.least_height) return false;
    if (object.box.sizes().head<2>().maxCoeff() < parameters_.least_length) return false;
    if (object.hits < parameters_.least_hits) return false;
    size_t touching = 0, in_view = 0;
    for (const uint32_t i : list) {
      const VoxelIndex at = VoxelIndexOf(members_[i].key);
      touching += TouchesWhatStays(at) ? 1 : 0;
      in_view += object.change == ChangeClass::kAppeared && WasInView(at) ? 1 : 0;
    }
    object.contact = static_cast<double>(touching) / count;
    object.in_view = static_cast<double>(in_view) / count;
    if (object.contact > parameters_.most_contact) return false;
    if (object.change != ChangeClass::kAppeared || object.in_view >= parameters_.least_in_view) return true;
    return object.hits >= parameters_.least_hits_there && KnownSidesOf(object) >= parameters_.least_known_sides;
  }

  /// On how many of the four sides of its box the earlier state had structure that still stands.
  int KnownSidesOf(const ChangedObject& object) const {
    const Eigen::Vector3d around = Eigen::Vector3d(parameters_.known_around, parameters_.known_around, 0) / voxel_size_;
    const Eigen::Vector3d low = object.box.min() / voxel_size_ - around, high = object.box.max() / voxel_size_ + around;
    const Eigen::Vector3d middle = (low + high) / 2, half = (high - low) / 2;
    std::array<int, 4> known{};
    for (auto z = static_cast<int>(low.z()); z < high.z(); ++z) {
      for (auto y = static_cast<int>(low.y()); y < high.y(); ++y) {
        for (auto x = static_cast<int>(low.x()); x < high.x(); ++x) {
          if (!StaysAt({x, y, z})) continue;
          const double east = (x - middle.x()) / half.x(), north = (y - middle.y()) / half.y();
          const size_t side = std::abs(east) > std::abs(north) ? (east > 0 ? 0 : 1) : (north > 0 ? 2 : 3);
          ++known[side];
        }
      }
    }
    return static_cast<int>(std::ranges::count_if(known, [](int voxels) { return voxels >= kEnoughKnown; }));
  }

  /// Whether something stands there in both states.
  bool StaysAt(const VoxelIndex& at) const {
    const Voxel *then = Find(before_, at), *now = Find(after_, at);
    return then != nullptr && now != nullptr && Stands(*then) && Stands(*now);
  }

  bool IsGroundAt(const VoxelIndex& at) const { return Find(before_, at)->ground || Find(after_, at)->ground; }

  /// Whether a neighbour is structure, other than ground, that stands in both states and is itself unchanged.
  bool TouchesWhatStays(const VoxelIndex& voxel) const {
    bool touches = false;
    ForEachAround(voxel, 1, [&](const VoxelIndex& at) {
      touches = touches || (!by_key_.contains(VoxelKeyOf(at)) && StaysAt(at) && !IsGroundAt(at));
    });
    return touches;
  }

  /// Whether the earlier state knew the ground below: then somebody has looked there, and it was not there.
  bool WasInView(const VoxelIndex& voxel) const {
    const int depth = static_cast<int>(std::ceil(parameters_.column_height / voxel_size_));
    for (int z = 0; z >= -depth; --z) {
      const Voxel* then = Find(before_, Shifted(voxel, 0, 0, z));
      if (then != nullptr && then->ground) return true;
    }
    return false;
  }

  const std::vector<Member> members_;
  const VoxelLookup& before_;
  const VoxelLookup& after_;
  const double voxel_size_;
  const ChangedObjectParameters& parameters_;
  absl::flat_hash_map<VoxelKey, uint32_t> by_key_;
};

}  // namespace

std::vector<ChangedObject> FindChangedObjects(std::span<const BlockChange> changes, const VoxelLookup& before,
                                              const VoxelLookup& after, double voxel_size,
                                              const ChangedObjectParameters& parameters) {
  return Finder(MembersOf(changes, voxel_size), before, after, voxel_size, parameters).Run();
}

}  // namespace mapkeep
