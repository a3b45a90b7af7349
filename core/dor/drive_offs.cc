#include "core/dor/drive_offs.h"

#include <absl/container/flat_hash_map.h>
#include <absl/container/flat_hash_set.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <optional>
#include <utility>

namespace mapkeep {
namespace {

// Metres.
constexpr double kBeside = 0.8;  // what sets out is first seen so near
constexpr double kReach = 4;     // and followed so far
constexpr double kMaxPart = 8;   // from the voxel that it begins with
constexpr double kMinLength = 1.2, kMaxLength = 7, kMinHeight = 0.7, kMaxHeight = 4;
constexpr double kHalfWidth = 1.2;                            // of the way that it takes
constexpr double kWidening = 0.15;                            // metres a metre of the way
constexpr std::array<double, 4> kRings = {0.8, 1.6, 2.4, 4};  // outer edges, from what stood

// Voxel edges.
constexpr double kTouching = 1.5;
constexpr double kAround = 2.05;
constexpr double kOutskirts = 2.5;

// Scans.
constexpr int kBefore = 8, kAfter = 10;  // what sets out is first seen so long before or after the last hit beside it
constexpr int kStays = 12;               // what is hit so long after T stands there still
constexpr int kFollowed = 40;            // after T
constexpr int kUnseen = 20;       // that must come after T: at the end of a session much is seen for the last time
constexpr int kPause = 6;         // between the last hits of voxels of one thing, where something sets out
constexpr int kBucket = 8;        // of the first, coarse look at the times
constexpr uint32_t kMinHits = 4;  // of a solid voxel

constexpr int kMinSolidAround = 8;          // voxels, for one to be of a body, not of what lies between two
constexpr size_t kMinAbandoned = 4;         // voxels
constexpr size_t kMinInRing = 4;            // voxels
constexpr double kMinBody = 100;            // voxels of 0.2 m
constexpr double kMaxStaying = 1;           // of the body's number: what it touches and stays
constexpr double kMaxStayingInside = 0.03;  // and that within its outline

using Cell = std::array<int32_t, 3>;

struct Extent {
  Eigen::Vector3d low, high;  // metres: what 96 % lie between, an axis
};

class DriveOffs {
 public:
  DriveOffs(const VoxelGrid& grid, std::span<const VoxelIndex> indices, const VoxelCounts& counts,
            std::span<const char> is_static, std::span<const char> is_dynamic, const DriveOffParameters& parameters)
      : grid_(grid),
        indices_(indices),
        counts_(counts),
        static_(is_static),
        dynamic_(is_dynamic),
        parameters_(parameters) {
    for (uint32_t id = 0; id < indices_.size(); ++id) {
      if (counts_.hits[id] > 0) end_ = std::max(end_, Last(id));
    }
  }

  std::vector<char> Find() {
    std::vector<char> marked(indices_.size());
    const std::vector<uint32_t> abandoned = FindAbandoned();
    abandoned_.insert(abandoned.begin(), abandoned.end());
    for (const uint32_t id : abandoned) {
      if (!abandoned_.contains(id)) continue;
      const std::vector<uint32_t> part = PartOf(id);
      for (const std::vector<uint32_t>& group : TakeGroups(part)) JudgeGroup(part, group, marked);
    }
    return marked;
  }

 private:
  int32_t First(uint32_t id) const { return static_cast<int32_t>(counts_.first_hit[id]); }
  int32_t Last(uint32_t id) const { return static_cast<int32_t>(counts_.last_hit[id]); }

  Cell CellOf(uint32_t id) const {
    const double edge = kBeside / parameters_.voxel_size;
    const auto at = [edge](int32_t c) { return static_cast<int32_t>(std::floor(c / edge)); };
    return {at(indices_[id].x), at(indices_[id].y), at(indices_[id].z)};
  }

  // Times in 64 buckets, which repeat.
  static uint64_t BitOf(int32_t time) { return uint64_t{1} << (time / kBucket & 63); }

  Eigen::Vector3d At(uint32_t id) const {
    return Eigen::Vector3d(indices_[id].x, indices_[id].y, indices_[id].z) * parameters_.voxel_size;
  }

  // `radius` in voxel edges.
  template <typename Visit>
  void ForEachInBall(double radius, uint32_t id, const Visit& visit) const {
    grid_.ForEachInBall(radius, indices_[id], [&](uint32_t other, int, int, int) { visit(other); });
  }

  // What is looked through as often as it is hit lies between two bodies: a range that is a mean of both.
  bool IsSolid(uint32_t id) const {
    return static_[id] && counts_.hits[id] >= kMinHits && counts_.hits[id] >= counts_.exposures[id];
  }

  bool IsOfBody(uint32_t id) const {
    if (!IsSolid(id)) return false;
    int solid = 0;
    ForEachInBall(kAround, id, [&](uint32_t other) { solid += IsSolid(other); });
    return solid >= kMinSolidAround;
  }

  // Voxels of bodies that were hit for the last time when something was first seen beside them.
  std::vector<uint32_t> FindAbandoned() {
    absl::flat_hash_map<Cell, uint64_t> first_seen;
    for (uint32_t id = 0; id < indices_.size(); ++id) {
      if (!dynamic_[id]) continue;
      const Cell cell = CellOf(id);
      moving_[cell].push_back(id);
      first_seen[cell] |= BitOf(First(id));
    }
    absl::flat_hash_map<Cell, uint64_t> seen_near;
    for (const auto& [cell, times] : first_seen) {
      const uint64_t about = times | std::rotl(times, 1) | std::rotr(times, 1) | std::rotr(times, 2);
      for (int i = 0; i < 27; ++i) {
        seen_near[{cell[0] + i % 3 - 1, cell[1] + i / 3 % 3 - 1, cell[2] + i / 9 - 1}] |= about;
      }
    }
    std::vector<char> is_abandoned(indices_.size());
    tbb::parallel_for(tbb::blocked_range<uint32_t>(0, static_cast<uint32_t>(indices_.size()), 1024),
                      [&](const auto& range) {
                        for (uint32_t id = range.begin(); id != range.end(); ++id)
                          is_abandoned[id] = IsAbandoned(id, seen_near);
                      });
    std::vector<uint32_t> abandoned;
    for (uint32_t id = 0; id < indices_.size(); ++id) {
      if (is_abandoned[id]) abandoned.push_back(id);
    }
    return abandoned;
  }

  // `seen_near`: by cell, when anything was first seen in it or beside it.
  bool IsAbandoned(uint32_t id, const absl::flat_hash_map<Cell, uint64_t>& seen_near) const {
    if (!IsSolid(id) || Last(id) > end_ - kUnseen) return false;
    const auto near = seen_near.find(CellOf(id));
    if (near == seen_near.end() || (near->second & BitOf(Last(id))) == 0 || !IsOfBody(id)) return false;
    int setting_out = 0, around = 0, staying = 0;
    ForEachInBall(kBeside / parameters_.voxel_size, id, [&](uint32_t other) {
      setting_out += dynamic_[other] && First(other) >= Last(id) - kBefore && First(other) <= Last(id) + kAfter;
      around += static_[other];
      staying += static_[other] && Last(other) > Last(id) + kStays;
    });
    return setting_out >= 2 && staying <= 0.3 * around;
  }

  // What hangs together with a voxel of a body.
  std::vector<uint32_t> PartOf(uint32_t begin) const {
    std::vector<uint32_t> part = {begin};
    absl::flat_hash_set<uint32_t> looked_at = {begin};
    for (size_t i = 0; i < part.size(); ++i) {
      ForEachInBall(kTouching, part[i], [&](uint32_t other) {
        if (!looked_at.insert(other).second || !IsOfBody(other)) return;
        if ((At(other) - At(begin)).norm() <= kMaxPart) part.push_back(other);
      });
    }
    return part;
  }

  // The abandoned voxels of a part that no other part had, by their last hits: one group for each time at which
  // something may have left.
  std::vector<std::vector<uint32_t>> TakeGroups(std::span<const uint32_t> part) {
    std::vector<std::pair<int32_t, uint32_t>> by_time;
    for (const uint32_t id : part) {
      if (abandoned_.erase(id) > 0) by_time.emplace_back(Last(id), id);
    }
    std::ranges::sort(by_time);
    std::vector<std::vector<uint32_t>> groups;
    for (size_t i = 0; i < by_time.size(); ++i) {
      if (i == 0 || by_time[i].first > by_time[i - 1].first + kPause) groups.emplace_back();
      groups.back().push_back(by_time[i].second);
    }
    std::erase_if(groups, [](const auto& group) { return group.size() < kMinAbandoned; });
    return groups;
  }

  void JudgeGroup(std::span<const uint32_t> part, const std::vector<uint32_t>& group, std::vector<char>& marked) const {
    const int32_t left_at = Last(group[group.size() * 8 / 10]);
    const std::vector<uint32_t> body = BodyOf(part, group, left_at);
    if (!IsCarSized(part, body, left_at) || !SetsOut(body, left_at)) return;
    for (const uint32_t id : body) {
      marked[id] = 1;
      ForEachInBall(kOutskirts, id, [&](uint32_t other) {
        if (static_[other] && Last(other) <= left_at + kStays) marked[other] = 1;
      });
    }
  }

  // The voxels of the part that are nearer, from voxel to voxel, to the group than to what stays.
  std::vector<uint32_t> BodyOf(std::span<const uint32_t> part, const std::vector<uint32_t>& group,
                               int32_t left_at) const {
    enum class Owner : uint8_t { kNobody, kStays, kLeft };
    absl::flat_hash_map<uint32_t, Owner> owners;
    std::array<std::vector<uint32_t>, 2> waves;  // of what stays, of what left
    for (const uint32_t id : part) {
      const bool stays = Last(id) > left_at + kStays;
      owners[id] = stays ? Owner::kStays : Owner::kNobody;
      if (stays) waves[0].push_back(id);
    }
    for (const uint32_t id : group) {
      if (owners[id] != Owner::kNobody) continue;
      owners[id] = Owner::kLeft;
      waves[1].push_back(id);
    }
    std::vector<uint32_t> body = waves[1];
    while (!waves[0].empty() || !waves[1].empty()) {
      for (const Owner owner : {Owner::kStays, Owner::kLeft}) {
        std::vector<uint32_t>& wave = waves[owner == Owner::kLeft];
        std::vector<uint32_t> next;
        for (const uint32_t id : wave) {
          ForEachInBall(kTouching, id, [&](uint32_t other) {
            const auto found = owners.find(other);
            if (found == owners.end() || found->second != Owner::kNobody) return;
            found->second = owner;
            next.push_back(other);
            if (owner == Owner::kLeft) body.push_back(other);
          });
        }
        wave = std::move(next);
      }
    }
    return body;
  }

  // What all but a share lie between, on both sides.
  Extent ExtentOf(std::span<const uint32_t> ids, double share) const {
    Extent extent;
    std::vector<double> values(ids.size());
    for (int axis = 0; axis < 3; ++axis) {
      std::ranges::transform(ids, values.begin(), [&](uint32_t id) { return At(id)[axis]; });
      std::ranges::sort(values);
      const auto outside = static_cast<size_t>(share * static_cast<double>(values.size()));
      extent.low[axis] = values[outside];
      extent.high[axis] = values[values.size() - 1 - outside];
    }
    return extent;
  }

  bool IsCarSized(std::span<const uint32_t> part, std::span<const uint32_t> body, int32_t left_at) const {
    // A surface of a given size has more voxels the smaller they are.
    const double more = std::clamp(std::pow(0.2 / parameters_.voxel_size, 2), 0.3, 4.0);
    if (static_cast<double>(body.size()) < more * kMinBody) return false;
    const Extent extent = ExtentOf(body, 0.02);
    const Eigen::Vector3d size = extent.high - extent.low;
    const double length = size.head<2>().maxCoeff();
    if (length < kMinLength || length > kMaxLength || size.z() < kMinHeight || size.z() > kMaxHeight) return false;
    const Extent outline = ExtentOf(body, 0.05);
    size_t staying = 0, inside = 0;
    for (const uint32_t id : part) {
      if (Last(id) <= left_at + kStays) continue;
      ++staying;
      const Eigen::Array2d at = At(id).head<2>();
      inside += (at >= outline.low.head<2>().array()).all() && (at <= outline.high.head<2>().array()).all();
    }
    const auto voxels = static_cast<double>(body.size());
    return static_cast<double>(staying) <= kMaxStaying * voxels &&
           static_cast<double>(inside) <= kMaxStayingInside * voxels;
  }

  // Something that moved and was first seen not long before or after a body was left.
  struct Mover {
    uint32_t id = 0;
    size_t ring = 0;
    int32_t after = 0;  // scans from then to its first hit
  };

  std::vector<Mover> MoversNear(std::span<const uint32_t> body, int32_t left_at) const {
    const int reach = static_cast<int>(std::ceil(kReach / kBeside));
    absl::flat_hash_set<Cell> of_body, near;
    for (const uint32_t id : body) of_body.insert(CellOf(id));
    for (const Cell& cell : of_body) {
      for (int z = -reach; z <= reach; ++z) {
        for (int y = -reach; y <= reach; ++y) {
          for (int x = -reach; x <= reach; ++x) near.insert({cell[0] + x, cell[1] + y, cell[2] + z});
        }
      }
    }
    std::vector<Mover> movers;
    for (const Cell& cell : near) {
      const auto found = moving_.find(cell);
      if (found == moving_.end()) continue;
      for (const uint32_t id : found->second) {
        const int32_t after = First(id) - left_at;
        if (after < -kBefore - kPause || after > kFollowed) continue;
        double squared = kReach * kReach;
        for (const uint32_t other : body) squared = std::min(squared, (At(id) - At(other)).squaredNorm());
        const auto ring = static_cast<size_t>(std::ranges::upper_bound(kRings, std::sqrt(squared)) - kRings.begin());
        if (ring < kRings.size()) movers.push_back({id, ring, after});
      }
    }
    return movers;
  }

  // From where what is first seen beside the body goes away: the first hits of what moved, ring by ring along the way,
  // begin when the body was left, come later and later, and take their time.
  bool SetsOut(std::span<const uint32_t> body, int32_t left_at) const {
    const std::vector<Mover> movers = MoversNear(body, left_at);
    const Extent extent = ExtentOf(body, 0.02);
    const Eigen::Vector2d middle = (extent.low + extent.high).head<2>() / 2;
    // Sums of voxel coordinates are exact, so the order of the movers does not show.
    Eigen::Array<int64_t, 2, 1> sum(0, 0);
    int64_t beside = 0;
    for (const Mover& mover : movers) {
      if (mover.ring > 0 || mover.after < -kStays / 3 || mover.after > kAfter) continue;
      sum += Eigen::Array<int64_t, 2, 1>(indices_[mover.id].x, indices_[mover.id].y);
      ++beside;
    }
    if (beside == 0) return false;
    const Eigen::Vector2d ahead =
        sum.cast<double>().matrix() / static_cast<double>(beside) * parameters_.voxel_size - middle;
    if (ahead.norm() < parameters_.voxel_size) return false;
    const Eigen::Vector2d way = ahead.normalized();
    std::array<std::vector<int32_t>, kRings.size()> times;
    for (const Mover& mover : movers) {
      const Eigen::Vector2d from = At(mover.id).head<2>() - middle;
      const double along = from.dot(way), aside = std::abs(from.x() * way.y() - from.y() * way.x());
      if (along >= 0 && aside <= kHalfWidth + kWidening * along) times[mover.ring].push_back(mover.after);
    }
    std::array<std::optional<int32_t>, kRings.size()> median;
    for (size_t ring = 0; ring < kRings.size(); ++ring) {
      if (times[ring].empty()) continue;
      const auto middle_one = times[ring].begin() + static_cast<std::ptrdiff_t>(times[ring].size() / 2);
      std::ranges::nth_element(times[ring], middle_one);
      median[ring] = *middle_one;
    }
    for (size_t ring = 0; ring < 3; ++ring) {
      if (times[ring].size() < kMinInRing) return false;
    }
    // The last ring holds much of what others do.
    const int32_t farthest = std::max(*median[2], median[3].value_or(*median[2]));
    return *median[0] >= -kBefore / 2 && *median[0] <= kBefore && *median[1] >= *median[0] &&
           *median[2] >= *median[1] && farthest >= *median[0] + parameters_.setting_out;
  }

  const VoxelGrid& grid_;
  std::span<const VoxelIndex> indices_;
  const VoxelCounts& counts_;
  std::span<const char> static_, dynamic_;
  const DriveOffParameters& parameters_;
  int32_t end_ = 0;                                          // the last scan that hit anything
  absl::flat_hash_map<Cell, std::vector<uint32_t>> moving_;  // what moved, by cells of kBeside
  absl::flat_hash_set<uint32_t> abandoned_;                  // that no part has been made of yet
};

}  // namespace

std::vector<char> FindDriveOffs(const VoxelGrid& grid, std::span<const VoxelIndex> indices, const VoxelCounts& counts,
                                std::span<const char> is_static, std::span<const char> is_dynamic,
                                const DriveOffParameters& parameters) {
  if (!counts.ordered) return std::vector<char>(grid.size());
  return DriveOffs(grid, indices, counts, is_static, is_dynamic, parameters).Find();
}

}  // namespace mapkeep
