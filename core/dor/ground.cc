#include "core/dor/ground.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

namespace mapkeep {
namespace {

constexpr double kSeedRadius = 6;         // metres around the sensor in which its ground is looked for
constexpr double kMaxSensorHeight = 10;   // metres
constexpr double kSensorHeightBin = 0.1;  // metres
constexpr int kReach = 3;                 // cells over which ground continues where it was not seen
constexpr double kMaxGrade = 0.3;         // rise by run of ground that is continued across such a gap
constexpr double kFurniture = 0.5;        // what stands on the ground is flat at this height above it, metres,
constexpr double kClearance = 2.0;        // up to this; a ground above another leaves room for whoever uses the lower

struct Level {
  std::pair<int32_t, int32_t> cell;
  double height = 0;
  bool ground = false;
};

}  // namespace

Ground::Cell Ground::CellOf(const Eigen::Vector3d& point) const {
  return {static_cast<int32_t>(std::floor(point.x() / parameters_.cell)),
          static_cast<int32_t>(std::floor(point.y() / parameters_.cell))};
}

Ground::Ground(std::span<const Eigen::Vector3d> anchors, std::span<const Eigen::Vector3d> sensors,
               const Parameters& parameters)
    : parameters_(parameters) {
  // Levels: runs of anchor heights in a cell without a gap larger than a step.
  std::vector<std::pair<Cell, double>> sorted(anchors.size());
  for (size_t i = 0; i < anchors.size(); ++i) sorted[i] = {CellOf(anchors[i]), anchors[i].z()};
  std::ranges::sort(sorted);
  std::vector<Level> levels;
  absl::flat_hash_map<Cell, std::pair<uint32_t, uint32_t>> of_cell;
  for (size_t begin = 0; begin < sorted.size();) {
    size_t end = begin + 1;
    double sum = sorted[begin].second;
    while (end < sorted.size() && sorted[end].first == sorted[begin].first &&
           sorted[end].second - sorted[end - 1].second < parameters.step) {
      sum += sorted[end++].second;
    }
    const auto index = static_cast<uint32_t>(levels.size());
    const auto [at, is_new] = of_cell.try_emplace(sorted[begin].first, index, index);
    at->second.second = index + 1;
    levels.push_back({sorted[begin].first, sum / static_cast<double>(end - begin)});
    begin = end;
  }

  const auto for_each_level_around = [&](const Cell& cell, int radius, const auto& visit) {
    for (int dy = -radius; dy <= radius; ++dy) {
      for (int dx = -radius; dx <= radius; ++dx) {
        const auto found = of_cell.find(Cell{cell.first + dx, cell.second + dy});
        if (found == of_cell.end()) continue;
        for (uint32_t i = found->second.first; i < found->second.second; ++i) {
          visit(i, dx * dx + dy * dy);
        }
      }
    }
  };

  // The sensor's height above ground is the one that most levels around its way agree on.
  const int seed_radius = static_cast<int>(kSeedRadius / parameters.cell);
  std::map<Cell, double> way;  // a cell that the sensor passed: its height there
  for (const Eigen::Vector3d& sensor : sensors) way.try_emplace(CellOf(sensor), sensor.z());
  std::vector<int64_t> votes(static_cast<size_t>(kMaxSensorHeight / kSensorHeightBin) + 1);
  for (const auto& passed : way) {
    for_each_level_around(passed.first, seed_radius, [&](uint32_t i, int) {
      const double below = passed.second - levels[i].height;
      if (below > 0 && below < kMaxSensorHeight) ++votes[static_cast<size_t>(below / kSensorHeightBin)];
    });
  }
  const auto best = std::ranges::max_element(votes);
  if (*best == 0) return;
  sensor_height_ = (static_cast<double>(best - votes.begin()) + 0.5) * kSensorHeightBin;

  // From the levels at that height, ground spreads to what it reaches without a step.
  std::vector<uint32_t> open;
  const auto accept = [&](uint32_t i) {
    if (std::exchange(levels[i].ground, true)) return;
    open.push_back(i);
  };
  for (const auto& passed : way) {
    for_each_level_around(passed.first, seed_radius, [&](uint32_t i, int) {
      if (std::abs(passed.second - levels[i].height - sensor_height_) < parameters.step) accept(i);
    });
  }
  std::array<double, 2 * kReach * kReach + 1> steps{};  // by squared distance in cells: how far ground may rise
  for (size_t squared = 0; squared < steps.size(); ++squared) {
    steps[squared] = std::max(parameters.step, kMaxGrade * parameters.cell * std::sqrt(static_cast<double>(squared)));
  }
  while (!open.empty()) {
    const Level from = levels[open.back()];
    open.pop_back();
    for_each_level_around(from.cell, kReach, [&](uint32_t i, int squared) {
      if (std::abs(levels[i].height - from.height) < steps[squared]) accept(i);
    });
  }
  // Bonnets and roofs of cars can be climbed in steps as well, but there is ground beside them.
  for (const Level& level : levels) {
    bool on_ground = false;
    for_each_level_around(level.cell, kReach, [&](uint32_t i, int) {
      const double above = level.height - levels[i].height;
      on_ground |= levels[i].ground && above > kFurniture && above < kClearance;
    });
    if (level.ground && !on_ground) levels_[level.cell].push_back(level.height);
  }
}

std::optional<double> Ground::HeightNear(const Eigen::Vector3d& point) const {
  const Cell cell = CellOf(point);
  std::optional<double> nearest;
  for (int ring = 0; ring <= kReach && !nearest; ++ring) {
    for (int dy = -ring; dy <= ring; ++dy) {
      for (int dx = -ring; dx <= ring; ++dx) {
        if (std::max(std::abs(dx), std::abs(dy)) != ring) continue;
        const auto found = levels_.find(Cell{cell.first + dx, cell.second + dy});
        if (found == levels_.end()) continue;
        for (const double level : found->second) {
          if (!nearest || std::abs(level - point.z()) < std::abs(*nearest - point.z())) nearest = level;
        }
      }
    }
  }
  return nearest;
}

}  // namespace mapkeep
