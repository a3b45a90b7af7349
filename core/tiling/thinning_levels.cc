#include "core/tiling/thinning_levels.h"

#include <absl/container/flat_hash_map.h>

#include <cstdint>
#include <tuple>
#include <utility>

namespace mapkeep {
namespace {

struct Cell {
  int32_t x, y, z;
  bool operator==(const Cell&) const = default;
  template <typename H>
  friend H AbslHashValue(H h, const Cell& cell) {
    return H::combine(std::move(h), cell.x, cell.y, cell.z);
  }
};

// The finaliser of SplitMix64 (Steele, Lea and Flood, "Fast Splittable Pseudorandom Number Generators", 2014).
uint64_t Mixed(uint64_t value) {
  value = (value ^ value >> 30) * 0xbf58476d1ce4e5b9U;
  value = (value ^ value >> 27) * 0x94d049bb133111ebU;
  return value ^ value >> 31;
}

// Where a place comes in the shuffle.
uint64_t RankOf(const TilePoint& point) {
  const auto low = static_cast<uint64_t>(static_cast<uint32_t>(point.x)) << 32 | static_cast<uint32_t>(point.y);
  return Mixed(Mixed(low + 0x9e3779b97f4a7c15U) + static_cast<uint32_t>(point.z));
}

bool ComesFirst(const TilePoint& a, uint64_t rank_a, const TilePoint& b, uint64_t rank_b) {
  return std::tie(rank_a, a.x, a.y, a.z) < std::tie(rank_b, b.x, b.y, b.z);
}

}  // namespace

ThinnedPoints ThinToLevel(std::span<const TilePoint> points, int level) {
  ThinnedPoints thinned;
  if (level == 0) {
    thinned.kept.assign(points.begin(), points.end());
    return thinned;
  }
  std::vector<uint64_t> ranks(points.size());
  absl::flat_hash_map<Cell, size_t> first;  // of a cell
  first.reserve(points.size() / 3);
  for (size_t i = 0; i < points.size(); ++i) {
    const TilePoint& point = points[i];
    ranks[i] = RankOf(point);
    const auto [at, is_new] = first.try_emplace({point.x >> level, point.y >> level, point.z >> level}, i);
    if (!is_new && ComesFirst(point, ranks[i], points[at->second], ranks[at->second])) at->second = i;
  }
  std::vector<bool> kept(points.size());
  for (const auto& [cell, index] : first) kept[index] = true;
  thinned.kept.reserve(first.size());
  thinned.rest.reserve(points.size() - first.size());
  for (size_t i = 0; i < points.size(); ++i) (kept[i] ? thinned.kept : thinned.rest).push_back(points[i]);
  return thinned;
}

}  // namespace mapkeep
