#include "core/registration/plan_search.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <tuple>

#include "core/registration/up_direction.h"

namespace mapkeep {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kUpright = 0.5;  // |z| of a wall's normal, at most
constexpr double kLevel = 0.85;   // z of a floor's normal, at least
constexpr int kReach = 2;         // tiles about its own that a place is compared with: 51.2 m
constexpr size_t kPlacesATile = 48;

int32_t CellAt(double metres, double edge) { return static_cast<int32_t>(std::floor(metres / edge)); }

// A place on its way: where the query's middle lies and how it is turned.
struct Guess {
  double x = 0, y = 0, yaw = 0;
  uint32_t score = 0;
};

bool Better(const Guess& a, const Guess& b) {
  return std::tuple(b.score, a.x, a.y, a.yaw) < std::tuple(a.score, b.x, b.y, b.yaw);
}

double TurnBetween(double a, double b) { return std::abs(std::remainder(a - b, 2 * std::numbers::pi)); }

// The best `count`, none twice.
std::vector<Guess> BestOf(std::vector<Guess> guesses, size_t count, const PlanSearchParameters& parameters) {
  std::ranges::sort(guesses, Better);
  std::vector<Guess> best;
  for (const Guess& guess : guesses) {
    if (best.size() >= count) break;
    const bool held = std::ranges::any_of(best, [&](const Guess& other) {
      return std::hypot(guess.x - other.x, guess.y - other.y) < parameters.apart &&
             TurnBetween(guess.yaw, other.yaw) < parameters.apart_turn * kDegree;
    });
    if (!held) best.push_back(guess);
  }
  return best;
}

// The walls about one tile in one place, pooled: cells of `pool` plan cells.
class Patch {
 public:
  Patch(const WallPlan& plan, WallPlan::TileIndex tile, int pool)
      : edge_(kPlanCell * pool),
        cells_(kPlanTileCells / pool),
        width_(cells_ * (2 * kReach + 1)),
        left_((tile.first - kReach) * cells_),
        bottom_((tile.second - kReach) * cells_),
        exact_(static_cast<size_t>(width_) * width_),
        near_(exact_.size()) {
    for (int ty = 0; ty <= 2 * kReach; ++ty) {
      for (int tx = 0; tx <= 2 * kReach; ++tx) {
        const WallPlan::Tile* source = plan.TileAt({tile.first - kReach + tx, tile.second - kReach + ty});
        if (source == nullptr) continue;
        for (int y = 0; y < kPlanTileCells; ++y) {
          uint16_t* row = exact_.data() + static_cast<size_t>(ty * cells_ + y / pool) * width_ + tx * cells_;
          const uint16_t* from = source->walls.data() + static_cast<size_t>(y) * kPlanTileCells;
          for (int x = 0; x < kPlanTileCells; ++x) row[x / pool] |= from[x];
        }
      }
    }
    // What is near: in a neighbouring cell.
    std::vector<uint16_t> across(exact_.size());
    for (int y = 0; y < width_; ++y) {
      const uint16_t* row = exact_.data() + static_cast<size_t>(y) * width_;
      uint16_t* to = across.data() + static_cast<size_t>(y) * width_;
      for (int x = 0; x < width_; ++x) {
        to[x] = row[x] | (x > 0 ? row[x - 1] : 0) | (x + 1 < width_ ? row[x + 1] : 0);
      }
    }
    for (int y = 0; y < width_; ++y) {
      for (int x = 0; x < width_; ++x) {
        const size_t i = static_cast<size_t>(y) * width_ + x;
        near_[i] = across[i] | (y > 0 ? across[i - width_] : 0) | (y + 1 < width_ ? across[i + width_] : 0);
      }
    }
  }

  double edge() const { return edge_; }
  int width() const { return width_; }
  int cells() const { return cells_; }
  const std::vector<uint16_t>& exact() const { return exact_; }
  const std::vector<uint16_t>& near() const { return near_; }

  // 2 for a wall in the cell that faces this way, 1 for one in a cell beside it.
  uint32_t Score(double x, double y, int facing) const {
    const int32_t cx = CellAt(x, edge_) - left_, cy = CellAt(y, edge_) - bottom_;
    if (cx < 0 || cy < 0 || cx >= width_ || cy >= width_) return 0;
    const size_t i = static_cast<size_t>(cy) * width_ + cx;
    return (exact_[i] >> facing & 1U) + (near_[i] >> facing & 1U);
  }

 private:
  double edge_;
  int cells_;  // of a tile, along an edge
  int width_;
  int32_t left_, bottom_;
  std::vector<uint16_t> exact_, near_;
};

struct TurnedWall {
  double x, y;
  int facing;
};

std::vector<TurnedWall> Turned(std::span<const PlanQuery::Wall> walls, double yaw) {
  const double c = std::cos(yaw), s = std::sin(yaw);
  std::vector<TurnedWall> turned;
  turned.reserve(walls.size());
  for (const PlanQuery::Wall& wall : walls) {
    turned.push_back({c * wall.x - s * wall.y, s * wall.x + c * wall.y, FacingOf(wall.facing + yaw)});
  }
  return turned;
}

// Coarse: every floor cell of a tile, every heading. A plane of bytes a facing makes sixteen places one addition.
std::vector<Guess> GuessesInTile(const PlanQuery& query, const WallPlan& plan, WallPlan::TileIndex index,
                                 const std::optional<Eigen::AlignedBox3d>& within,
                                 const PlanSearchParameters& parameters) {
  constexpr int kCells = kPlanTileCells / kPlanFloorCells;
  static_assert(kCells == 16);
  const Patch patch(plan, index, kPlanFloorCells);
  const auto width = static_cast<size_t>(patch.width());
  // Which places are to be looked at: those with a floor in them or beside them.
  std::array<uint8_t, size_t{kCells} * kCells> wanted{};
  std::array<uint8_t, kCells> rows{};
  for (int y = 0; y < kCells; ++y) {
    for (int x = 0; x < kCells; ++x) {
      const int32_t cx = index.first * kCells + x, cy = index.second * kCells + y;
      if (within) {
        const Eigen::Vector2d at((cx + 0.5) * kPlanFloorCell, (cy + 0.5) * kPlanFloorCell);
        if (at.x() < within->min().x() || at.y() < within->min().y() || at.x() > within->max().x() ||
            at.y() > within->max().y()) {
          continue;
        }
      }
      if (!plan.FloorAt(cx, cy)) continue;
      wanted[y * kCells + x] = 1;
      rows[y] = 1;
    }
  }
  std::vector<uint8_t> planes(kPlanFacings * width * width);
  for (int facing = 0; facing < kPlanFacings; ++facing) {
    uint8_t* plane = planes.data() + facing * width * width;
    for (size_t i = 0; i < width * width; ++i) {
      plane[i] = static_cast<uint8_t>((patch.exact()[i] >> facing & 1U) + (patch.near()[i] >> facing & 1U));
    }
  }
  const auto walls = std::span(query.walls).first(std::min(query.walls.size(), parameters.coarse_walls));
  const int turns = std::max(1, static_cast<int>(std::lround(360 / parameters.coarse_turn)));
  std::array<Guess, size_t{kCells} * kCells> best{};
  std::array<uint16_t, size_t{kCells} * kCells> sums;
  // Bytes are added up first, sixteen at once, and taken over before one can overflow.
  std::array<uint8_t, size_t{kCells} * kCells> bytes{};
  constexpr int kMostInBytes = 127;  // walls, each worth at most 2
  const auto take_over = [&] {
    for (size_t i = 0; i < sums.size(); ++i) sums[i] = static_cast<uint16_t>(sums[i] + bytes[i]);
    bytes.fill(0);
  };
  std::vector<Guess> guesses;
  for (int turn = 0; turn < turns; ++turn) {
    const double yaw = turn * 2 * std::numbers::pi / turns;
    sums.fill(0);
    int in_bytes = 0;
    for (const TurnedWall& wall : Turned(walls, yaw)) {
      // From the middle of a cell.
      const int32_t dx = CellAt(wall.x + patch.edge() / 2, patch.edge());
      const int32_t dy = CellAt(wall.y + patch.edge() / 2, patch.edge());
      constexpr int kMost = kReach * kCells;
      if (dx < -kMost || dx > kMost || dy < -kMost || dy > kMost) continue;
      const uint8_t* plane = planes.data() + wall.facing * width * width;
      for (int y = 0; y < kCells; ++y) {
        if (rows[y] == 0) continue;
        const uint8_t* row = plane + static_cast<size_t>(kMost + dy + y) * width + kMost + dx;
        uint8_t* sum = bytes.data() + static_cast<size_t>(y) * kCells;
        for (int x = 0; x < kCells; ++x) sum[x] = static_cast<uint8_t>(sum[x] + row[x]);
      }
      if (++in_bytes == kMostInBytes) {
        take_over();
        in_bytes = 0;
      }
    }
    take_over();
    for (size_t i = 0; i < sums.size(); ++i) {
      if (wanted[i] == 0 || sums[i] <= best[i].score) continue;
      best[i] = {(index.first * kCells + static_cast<double>(i % kCells) + 0.5) * kPlanFloorCell,
                 (index.second * kCells + static_cast<double>(i / kCells) + 0.5) * kPlanFloorCell, yaw, sums[i]};
    }
  }
  for (const Guess& guess : best) {
    if (guess.score > 0) guesses.push_back(guess);
  }
  std::ranges::sort(guesses, Better);
  if (guesses.size() > kPlacesATile) guesses.resize(kPlacesATile);
  return guesses;
}

// The best place about each guess, on finer cells: half a coarser cell and half a coarser turn to either side.
void Refine(std::span<const PlanQuery::Wall> pieces, const WallPlan& plan, int pool, double turn_step,
            std::vector<Guess>& guesses) {
  constexpr int kSteps = 1, kTurns = 2;  // to either side
  std::map<WallPlan::TileIndex, std::vector<size_t>> by_tile;
  for (size_t i = 0; i < guesses.size(); ++i) {
    constexpr double kTile = kPlanCell * kPlanTileCells;
    by_tile[{CellAt(guesses[i].x, kTile), CellAt(guesses[i].y, kTile)}].push_back(i);
  }
  const std::vector<std::pair<WallPlan::TileIndex, std::vector<size_t>>> groups(by_tile.begin(), by_tile.end());
  tbb::parallel_for(size_t{0}, groups.size(), [&](size_t group) {
    const Patch patch(plan, groups[group].first, pool);
    for (const size_t i : groups[group].second) {
      const Guess guess = guesses[i];
      Guess best;
      for (int turn = -kTurns; turn <= kTurns; ++turn) {
        const double yaw = guess.yaw + turn * turn_step;
        const std::vector<TurnedWall> walls = Turned(pieces, yaw);
        for (int dy = -kSteps; dy <= kSteps; ++dy) {
          for (int dx = -kSteps; dx <= kSteps; ++dx) {
            Guess tried{guess.x + dx * patch.edge(), guess.y + dy * patch.edge(), yaw, 0};
            for (const TurnedWall& wall : walls) {
              tried.score += patch.Score(tried.x + wall.x, tried.y + wall.y, wall.facing);
            }
            if (tried.score > best.score) best = tried;
          }
        }
      }
      if (best.score > 0)
        guesses[i] = best;
      else
        guesses[i].score = 0;
    }
  });
}

// The height that most floors agree on, and what a place is worth.
PlanPlace PlaceOf(const PlanQuery& query, const WallPlan& plan, const Guess& guess) {
  constexpr double kSameHeight = 0.3;  // metres
  const double c = std::cos(guess.yaw), s = std::sin(guess.yaw);
  std::vector<float> rises;
  for (const Eigen::Vector3f& floor : query.floors) {
    const double x = guess.x + c * floor.x() - s * floor.y(), y = guess.y + s * floor.x() + c * floor.y();
    const auto height = plan.FloorAt(CellAt(x, kPlanFloorCell), CellAt(y, kPlanFloorCell));
    if (height) rises.push_back(*height - floor.z());
  }
  double rise = 0;
  if (!rises.empty()) {
    std::ranges::sort(rises);
    rise = rises[rises.size() / 2];
  }
  const auto agree = std::ranges::count_if(rises, [&](float other) { return std::abs(other - rise) <= kSameHeight; });
  PlanPlace place;
  const Eigen::AngleAxisd turn(guess.yaw, Eigen::Vector3d::UnitZ());
  place.pose = Eigen::Translation3d(guess.x, guess.y, rise) * turn * Eigen::Translation3d(-query.middle) *
               Pose(Eigen::Isometry3d(Eigen::Quaterniond(query.level)));
  place.walls = static_cast<double>(guess.score) / static_cast<double>(2 * std::max<size_t>(query.walls.size(), 1));
  place.floors = static_cast<double>(agree) / static_cast<double>(std::max<size_t>(query.floors.size(), 1));
  return place;
}

// Pieces of wall, drawn so that a facing counts with the root of how often it occurs: a long straight facade says less
// about where one is than the few walls across.
template <typename Piece>
std::vector<Piece> Chosen(const std::vector<Piece>& all, std::span<const int> facings, size_t count) {
  std::array<std::vector<size_t>, kPlanFacings> by_facing;
  for (size_t i = 0; i < all.size(); ++i) by_facing[facings[i]].push_back(i);
  double sum = 0;
  for (const auto& members : by_facing) sum += std::sqrt(static_cast<double>(members.size()));
  // Each piece gets a place in the order: those of a facing are spread evenly over it.
  std::vector<std::pair<double, size_t>> order;
  for (const auto& members : by_facing) {
    const double share = std::sqrt(static_cast<double>(members.size())) / std::max(sum, 1e-9);
    // Of neighbours, not the first few but every so many: by the golden section.
    for (size_t k = 0; k < members.size(); ++k) {
      const double spread = std::fmod(static_cast<double>(k) * std::numbers::phi, 1.0);
      order.emplace_back(spread * static_cast<double>(members.size()) / share, members[k]);
    }
  }
  std::ranges::sort(order);
  std::vector<Piece> chosen;
  for (size_t k = 0; k < std::min(count, order.size()); ++k) chosen.push_back(all[order[k].second]);
  return chosen;
}

Eigen::Vector3d UpOf(const MatchCloud& cloud) {
  std::vector<SurfacePatch> patches;
  patches.reserve(cloud.normals.size());
  for (const Eigen::Vector3f& normal : cloud.normals) patches.push_back({normal.cast<double>(), normal.z() > 0});
  return EstimateUpDirection(patches, Eigen::Vector3d::UnitZ()).value_or(Eigen::Vector3d::UnitZ());
}

}  // namespace

double WallsMet(const PlanQuery& query, const WallPlan& plan, const Pose& pose) {
  const Eigen::Matrix3d turn = pose.linear() * query.level.transpose();
  const double yaw = std::atan2(turn(1, 0), turn(0, 0));
  const Eigen::Vector3d middle = pose.translation() + turn * query.middle;
  uint32_t known = 0, met = 0;
  for (const TurnedWall& wall : Turned(query.walls, yaw)) {
    const double x = middle.x() + wall.x, y = middle.y() + wall.y;
    const int32_t cx = CellAt(x, kPlanCell), cy = CellAt(y, kPlanCell);
    uint16_t near = 0;
    for (int32_t dy = -1; dy <= 1; ++dy) {
      for (int32_t dx = -1; dx <= 1; ++dx) near |= plan.WallsAt(cx + dx, cy + dy);
    }
    bool is_known = near != 0;
    const int32_t fx = CellAt(x, kPlanFloorCell), fy = CellAt(y, kPlanFloorCell);
    for (int32_t dy = -1; dy <= 1 && !is_known; ++dy) {
      for (int32_t dx = -1; dx <= 1 && !is_known; ++dx) is_known = plan.FloorAt(fx + dx, fy + dy).has_value();
    }
    if (!is_known) continue;
    ++known;
    met += (near >> wall.facing & 1U) + (plan.WallsAt(cx, cy) >> wall.facing & 1U);
  }
  return met / (2.0 * std::max(known, 1U));
}

PlanQuery PlanQueryOf(const FacingPoints& submap, const PlanSearchParameters& parameters) {
  PlanQuery query;
  const MatchCloud cloud = MakeMatchCloud(submap, parameters.voxel_size, parameters.normal_radius);
  query.level = Eigen::Quaterniond::FromTwoVectors(UpOf(cloud), Eigen::Vector3d::UnitZ()).toRotationMatrix();
  using Cell = std::tuple<int32_t, int32_t, int>;
  std::vector<std::pair<Cell, Eigen::Vector3d>> walls;  // x, y, facing
  std::vector<PlanQuery::Piece> pieces;
  std::vector<int> piece_facings;
  std::map<std::pair<int32_t, int32_t>, Eigen::Vector3d> floors;
  for (size_t i = 0; i < cloud.points.size(); ++i) {
    const Eigen::Vector3d point = query.level * cloud.points[i];
    const Eigen::Vector3d normal = query.level * cloud.normals[i].cast<double>();
    if (std::abs(normal.z()) <= kUpright) {
      const double facing = std::atan2(normal.y(), normal.x());
      walls.push_back({{CellAt(point.y(), kPlanCell), CellAt(point.x(), kPlanCell), FacingOf(facing)},
                       {point.x(), point.y(), facing}});
      pieces.push_back({cloud.points[i].cast<float>(), cloud.normals[i]});
      piece_facings.push_back(FacingOf(facing));
    }
    if (normal.z() >= kLevel) {
      const auto [held, fresh] =
          floors.try_emplace({CellAt(point.y(), kPlanFloorCell), CellAt(point.x(), kPlanFloorCell)}, point);
      if (!fresh && point.z() < held->second.z()) held->second = point;
    }
  }
  if (floors.empty()) return query;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const auto& [cell, floor] : floors) mean += floor / static_cast<double>(floors.size());
  query.middle = std::ranges::min_element(floors, {}, [&](const auto& floor) {
                   return (floor.second - mean).template head<2>().squaredNorm();
                 })->second;
  for (const auto& [cell, floor] : floors) query.floors.push_back((floor - query.middle).cast<float>());
  std::ranges::stable_sort(walls, {}, [](const auto& wall) { return wall.first; });
  std::vector<PlanQuery::Wall> all;
  std::vector<int> facings;
  for (size_t i = 0; i < walls.size(); ++i) {
    if (i > 0 && walls[i].first == walls[i - 1].first) continue;
    const Eigen::Vector3d& wall = walls[i].second;
    all.push_back({static_cast<float>(wall.x() - query.middle.x()), static_cast<float>(wall.y() - query.middle.y()),
                   static_cast<float>(wall.z())});
    facings.push_back(FacingOf(wall.z()));
  }
  query.walls = Chosen(all, facings, parameters.walls);
  query.pieces = Chosen(pieces, piece_facings, parameters.pieces);
  return query;
}

std::vector<PlanPlace> SearchPlan(const PlanQuery& query, const WallPlan& plan,
                                  const std::optional<Eigen::AlignedBox3d>& within,
                                  const PlanSearchParameters& parameters) {
  if (query.walls.empty() || query.floors.empty()) return {};
  std::vector<WallPlan::TileIndex> tiles;
  for (const WallPlan::TileIndex& tile : plan.tiles_with_floor()) {
    constexpr double kTile = kPlanCell * kPlanTileCells;
    if (within && (tile.first * kTile > within->max().x() || tile.second * kTile > within->max().y() ||
                   (tile.first + 1) * kTile < within->min().x() || (tile.second + 1) * kTile < within->min().y())) {
      continue;
    }
    tiles.push_back(tile);
  }
  std::vector<std::vector<Guess>> by_tile(tiles.size());
  tbb::parallel_for(size_t{0}, tiles.size(),
                    [&](size_t i) { by_tile[i] = GuessesInTile(query, plan, tiles[i], within, parameters); });
  std::vector<Guess> guesses;
  for (const auto& part : by_tile) guesses.insert(guesses.end(), part.begin(), part.end());
  guesses = BestOf(std::move(guesses), parameters.coarse_places, parameters);
  const std::span<const PlanQuery::Wall> walls(query.walls);
  Refine(walls.first(std::min(walls.size(), parameters.walls / 2)), plan, 2, parameters.coarse_turn / 3 * kDegree,
         guesses);
  guesses = BestOf(std::move(guesses), parameters.fine_places, parameters);
  Refine(walls, plan, 1, parameters.coarse_turn / 8 * kDegree, guesses);
  guesses = BestOf(std::move(guesses), parameters.candidates, parameters);
  std::vector<PlanPlace> places;
  for (const Guess& guess : guesses) {
    if (guess.score > 0) places.push_back(PlaceOf(query, plan, guess));
  }
  return places;
}

}  // namespace mapkeep
