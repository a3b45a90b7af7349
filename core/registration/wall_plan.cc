#include "core/registration/wall_plan.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace mapkeep {
namespace {

constexpr double kUpright = 0.5;         // |z| of the normal of a wall is at most this: within 30 degrees of upright
constexpr double kLevel = 0.85;          // z of the normal of a floor is at least this
constexpr double kFacingOverlap = 0.35;  // of a facing's width from its middle beyond which the next one counts, too
constexpr uint32_t kMinPoints = 2;       // of one facing that make a wall
constexpr double kLimit = 1e6;           // cells from the origin

constexpr int kTileFloors = kPlanTileCells / kPlanFloorCells;

int32_t FloorDiv(int32_t a, int32_t b) { return a / b - (a % b < 0 ? 1 : 0); }

struct Facing {
  int bin = 0;
  uint16_t bits = 0;
};

Facing FacingsOf(const Eigen::Vector3d& normal) {
  const double turn = std::atan2(normal.y(), normal.x()) / (2 * std::numbers::pi) * kPlanFacings;
  const double nearest = std::round(turn);
  const auto bin = static_cast<int>(nearest) & (kPlanFacings - 1);
  Facing facing{bin, static_cast<uint16_t>(1U << bin)};
  if (turn - nearest > kFacingOverlap) facing.bits |= 1U << ((bin + 1) & (kPlanFacings - 1));
  if (turn - nearest < -kFacingOverlap) facing.bits |= 1U << ((bin - 1) & (kPlanFacings - 1));
  return facing;
}

}  // namespace

int FacingOf(double angle) {
  return static_cast<int>(std::round(angle / (2 * std::numbers::pi) * kPlanFacings)) & (kPlanFacings - 1);
}

PlanPart PlanOf(std::span<const Eigen::Vector3d> points, std::span<const Eigen::Vector3d> normals) {
  struct Seen {
    int32_t y, x;
    uint16_t bits;
  };
  std::vector<Seen> walls;
  std::vector<PlanFloor> floors;
  for (size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d& normal = normals[i];
    const Eigen::Vector2d cell = (points[i].head<2>() / kPlanCell).array().floor();
    if (!(cell.cwiseAbs().maxCoeff() < kLimit) || normal.isZero()) continue;
    const auto x = static_cast<int32_t>(cell.x()), y = static_cast<int32_t>(cell.y());
    if (std::abs(normal.z()) <= kUpright) walls.push_back({y, x, FacingsOf(normal).bits});
    if (normal.z() >= kLevel) {
      floors.push_back({FloorDiv(x, kPlanFloorCells), FloorDiv(y, kPlanFloorCells), static_cast<float>(points[i].z())});
    }
  }
  const auto before = [](const auto& a, const auto& b) { return std::pair(a.y, a.x) < std::pair(b.y, b.x); };
  std::ranges::sort(walls, before);
  PlanPart plan;
  for (size_t begin = 0; begin < walls.size();) {
    std::array<uint32_t, kPlanFacings> counts{};
    size_t end = begin;
    for (; end < walls.size() && walls[end].y == walls[begin].y && walls[end].x == walls[begin].x; ++end) {
      for (int bin = 0; bin < kPlanFacings; ++bin) counts[bin] += walls[end].bits >> bin & 1;
    }
    PlanWall wall{walls[begin].x, walls[begin].y, 0};
    for (int bin = 0; bin < kPlanFacings; ++bin) wall.facings |= (counts[bin] >= kMinPoints ? 1U : 0U) << bin;
    if (wall.facings != 0) plan.walls.push_back(wall);
    begin = end;
  }
  std::ranges::sort(floors, [](const PlanFloor& a, const PlanFloor& b) {
    return std::tuple(a.y, a.x, a.height) < std::tuple(b.y, b.x, b.height);
  });
  for (const PlanFloor& floor : floors) {
    if (plan.floors.empty() || plan.floors.back().x != floor.x || plan.floors.back().y != floor.y) {
      plan.floors.push_back(floor);
    }
  }
  return plan;
}

WallPlan::WallPlan(std::span<const std::shared_ptr<const PlanPart>> parts) {
  for (const auto& part : parts) {
    TileIndex last{std::numeric_limits<int32_t>::max(), 0};
    Tile* tile = nullptr;
    const auto at = [&](TileIndex index) {
      if (tile == nullptr || index != last) {
        last = index;
        tile = &MakeTile(index);
      }
    };
    for (const PlanWall& wall : part->walls) {
      const TileIndex index{FloorDiv(wall.x, kPlanTileCells), FloorDiv(wall.y, kPlanTileCells)};
      at(index);
      tile->walls[(wall.y - index.second * kPlanTileCells) * kPlanTileCells + wall.x - index.first * kPlanTileCells] |=
          wall.facings;
    }
    for (const PlanFloor& floor : part->floors) {
      const TileIndex index{FloorDiv(floor.x, kTileFloors), FloorDiv(floor.y, kTileFloors)};
      at(index);
      float& height =
          tile->floors[(floor.y - index.second * kTileFloors) * kTileFloors + floor.x - index.first * kTileFloors];
      height = std::isnan(height) ? floor.height : std::min(height, floor.height);
      if (!tile->has_floor) with_floor_.push_back(index);
      tile->has_floor = true;
    }
  }
  std::ranges::sort(with_floor_);
}

WallPlan::Tile& WallPlan::MakeTile(TileIndex index) {
  std::unique_ptr<Tile>& tile = tiles_[KeyOf(index)];
  if (!tile) {
    tile = std::make_unique<Tile>();
    tile->floors.fill(std::numeric_limits<float>::quiet_NaN());
  }
  return *tile;
}

const WallPlan::Tile* WallPlan::TileAt(TileIndex index) const {
  const auto found = tiles_.find(KeyOf(index));
  return found == tiles_.end() ? nullptr : found->second.get();
}

uint16_t WallPlan::WallsAt(int32_t x, int32_t y) const {
  const TileIndex index{FloorDiv(x, kPlanTileCells), FloorDiv(y, kPlanTileCells)};
  const Tile* tile = TileAt(index);
  if (tile == nullptr) return 0;
  return tile->walls[(y - index.second * kPlanTileCells) * kPlanTileCells + x - index.first * kPlanTileCells];
}

std::optional<float> WallPlan::FloorAt(int32_t x, int32_t y) const {
  const TileIndex index{FloorDiv(x, kTileFloors), FloorDiv(y, kTileFloors)};
  const Tile* tile = TileAt(index);
  if (tile == nullptr) return {};
  const float height = tile->floors[(y - index.second * kTileFloors) * kTileFloors + x - index.first * kTileFloors];
  if (std::isnan(height)) return {};
  return height;
}

}  // namespace mapkeep
