#include "tests/bench/lifelong_breakdown.h"

#include <algorithm>
#include <cstdio>
#include <limits>

namespace mapkeep {
namespace {

constexpr std::array<double, 4> kRings = {10, 25, 50, std::numeric_limits<double>::infinity()};  // metres
constexpr size_t kWorst = 12;

const char* NameOf(JudgedAs as) {
  constexpr std::array<const char*, 3> kNames = {"stands", "moving", "left"};
  return kNames[static_cast<size_t>(as)];
}

}  // namespace

LifelongBreakdown::Cause LifelongBreakdown::CauseOf(const JudgedPoint& point) const {
  if (point.right) return kRight;
  const bool kept = cells_.kept.HasNear(point.position);
  if (point.as != JudgedAs::kStatic) return kept ? kKept : kStored;
  if (!kept) return kRemoved;
  return cells_.map_all.HasNear(point.position) ? kFiltered : kDropped;
}

void LifelongBreakdown::Add(const JudgedPoint& point) {
  double nearest = std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < session_.truth.size(); i += 4) {
    nearest = std::min(nearest, (session_.truth[i].translation() - point.position).norm());
  }
  const auto ring = std::ranges::find_if(kRings, [&](double end) { return nearest < end; }) - kRings.begin();
  std::string kind = "?";
  for (const SceneObject& object : session_.objects) {
    if ((object.id & 0xffff) == (point.id & 0xffff)) kind = mapkeep::NameOf(object.kind);
  }
  const Cause cause = CauseOf(point);
  for (Counts* counts : {&by_kind_[{point.as, kind, static_cast<int>(ring)}], &by_object_[{point.as, point.id}]}) {
    ++counts->all;
    ++counts->by_cause[cause];
    counts->sum += point.position;
  }
}

void LifelongBreakdown::Print() const {
  std::printf("    %-7s %-12s %6s %9s %8s %8s %8s %8s %8s\n", "", "", "within", "points", "removed", "dropped",
              "filtered", "kept", "stored");
  const auto print = [](const Counts& counts) {
    std::printf(" %9lu", counts.all);
    for (int cause = kRemoved; cause < kCauses; ++cause) std::printf(" %8lu", counts.by_cause[cause]);
    std::printf("\n");
  };
  for (const auto& [key, counts] : by_kind_) {
    const auto& [as, kind, ring] = key;
    std::printf("    %-7s %-12s %6g", NameOf(as), kind.c_str(), kRings[ring]);
    print(counts);
  }
  std::vector<std::pair<std::pair<JudgedAs, uint32_t>, Counts>> worst(by_object_.begin(), by_object_.end());
  const auto wrong = [](const auto& entry) { return entry.second.all - entry.second.by_cause[kRight]; };
  std::ranges::sort(worst, [&](const auto& a, const auto& b) { return wrong(a) > wrong(b); });
  if (worst.size() > kWorst) worst.resize(kWorst);
  for (const auto& [key, counts] : worst) {
    const SceneObject* object = nullptr;
    for (const SceneObject& candidate : session_.objects) {
      if ((candidate.id & 0xffff) == (key.second & 0xffff)) object = &candidate;
    }
    const Eigen::Vector3d at = counts.sum / static_cast<double>(counts.all);
    std::printf("    %-7s %-12s %6u at %.0f %.0f (%s)", NameOf(key.first),
                object ? std::string(mapkeep::NameOf(object->kind)).c_str() : "?", key.second, at.x(), at.y(),
                object ? std::string(mapkeep::NameOf(object->state)).c_str() : "?");
    print(counts);
  }
}

}  // namespace mapkeep
