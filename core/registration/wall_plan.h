#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

namespace mapkeep {

inline constexpr double kPlanCell = 0.4;   ///< metres: edge of a cell of a plan
inline constexpr int kPlanFacings = 16;    ///< directions that a wall may face, told apart in a plan
inline constexpr int kPlanTileCells = 64;  ///< cells of a tile of a plan, along an edge
inline constexpr int kPlanFloorCells = 4;  ///< cells of a floor cell, along an edge
inline constexpr double kPlanFloorCell = kPlanFloorCells * kPlanCell;

/// A cell of a plan in which something stands upright.
struct PlanWall {
  int32_t x = 0, y = 0;  ///< floor(position / kPlanCell)
  uint16_t facings = 0;  ///< bit FacingOf(normal), and that of the next facing if the normal is near it
  bool operator==(const PlanWall&) const = default;
};

/// A floor cell in which there is ground.
struct PlanFloor {
  int32_t x = 0, y = 0;  ///< floor(position / kPlanFloorCell)
  float height = 0;      ///< metres: the lowest
  bool operator==(const PlanFloor&) const = default;
};

/// What a part of a map looks like from straight above: walls with the way they face, and floors with their heights. It
/// depends on nothing but the part's own voxels, so that it can be kept for each state of a part. Both in order of y,
/// then x, no cell twice.
struct PlanPart {
  std::vector<PlanWall> walls;
  std::vector<PlanFloor> floors;
};

/// The plan of points with unit normals towards the free side (zero where unknown), z up. A wall needs two points in a
/// cell that face the same way.
PlanPart PlanOf(std::span<const Eigen::Vector3d> points, std::span<const Eigen::Vector3d> normals);

/// Which of the kPlanFacings directions, counted from x towards y, is nearest to an angle in radians.
int FacingOf(double angle);

/// A plan that can be searched: parts joined, in tiles.
class WallPlan {
 public:
  struct Tile {
    std::array<uint16_t, size_t{kPlanTileCells} * kPlanTileCells> walls{};  // facings by cell, x fastest
    std::array<float, size_t{kPlanTileCells / kPlanFloorCells} * (kPlanTileCells / kPlanFloorCells)>
        floors;  // not a number where there is none
    bool has_floor = false;
  };
  using TileIndex = std::pair<int32_t, int32_t>;  // x, y

  explicit WallPlan(std::span<const std::shared_ptr<const PlanPart>> parts);

  /// Tiles that have a floor, in order: only there can a robot have been.
  const std::vector<TileIndex>& tiles_with_floor() const { return with_floor_; }
  /// The tile, or nullptr where the map has nothing.
  const Tile* TileAt(TileIndex index) const;
  /// Facings of the walls of a cell; 0 if there are none.
  uint16_t WallsAt(int32_t x, int32_t y) const;
  /// Height of the floor in a floor cell, metres.
  std::optional<float> FloorAt(int32_t x, int32_t y) const;

 private:
  static uint64_t KeyOf(TileIndex index) {
    return static_cast<uint64_t>(static_cast<uint32_t>(index.second)) << 32 | static_cast<uint32_t>(index.first);
  }
  Tile& MakeTile(TileIndex index);

  std::unordered_map<uint64_t, std::unique_ptr<Tile>> tiles_;
  std::vector<TileIndex> with_floor_;
};

}  // namespace mapkeep
