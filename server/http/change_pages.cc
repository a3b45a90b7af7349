#include "server/http/change_pages.h"

#include <absl/strings/str_cat.h>

#include <array>
#include <memory>
#include <utility>
#include <vector>

#include "core/tiling/gltf_points.h"
#include "core/tiling/thinning_levels.h"
#include "server/http/content_coding.h"
#include "storage/map_diff.h"

namespace mapkeep {
namespace {

constexpr uint64_t kFormat = 1;  // rises when the answers change with the program
constexpr size_t kMostPoints = 2'000'000;

struct Epochs {
  std::unique_ptr<Snapshot> before, after;
};

absl::StatusOr<Epochs> OpenBoth(const PageContext& context, const std::string& map, uint64_t before, uint64_t after) {
  auto old_one = context.maps.Open(map, before);
  if (!old_one.ok()) return old_one.status();
  auto new_one = context.maps.Open(map, after);
  if (!new_one.ok()) return new_one.status();
  return Epochs{*std::move(old_one), *std::move(new_one)};
}

// Points a class, thinned together whenever they become too many.
class ChangedPoints {
 public:
  explicit ChangedPoints(const PointSelection& selection) : selection_(selection) { selection_.static_only = false; }

  void Add(const Block& block, ChangeClass change) {
    std::vector<TilePoint>& points = points_[static_cast<size_t>(change)];
    added_ -= points.size();
    AppendPoints(block, selection_, points);
    added_ += points.size();
    while (added_ > kMostPoints) Thin(level_ + 1);
  }

  std::string Encode(PointTileOptions options) {
    if (level_ > 0) Thin(level_);
    std::vector<TilePoint> points;
    std::vector<ChangeClass> classes;
    for (size_t change = 0; change < points_.size(); ++change) {
      points.insert(points.end(), points_[change].begin(), points_[change].end());
      classes.resize(points.size(), static_cast<ChangeClass>(change));
    }
    options.classes = classes;
    return EncodePointTile(points, options);
  }

 private:
  void Thin(int level) {
    level_ = level;
    added_ = 0;
    for (std::vector<TilePoint>& points : points_) {
      points = ThinToLevel(points, level).kept;
      added_ += points.size();
    }
  }

  PointSelection selection_;
  std::array<std::vector<TilePoint>, 3> points_;
  size_t added_ = 0;
  int level_ = 0;
};

std::string CountsJson(uint64_t appeared, uint64_t disappeared, uint64_t unstable) {
  return absl::StrCat(R"({"appeared":)", appeared, R"(,"disappeared":)", disappeared, R"(,"unstable":)", unstable,
                      "}\n");
}

absl::StatusOr<std::string> Count(const Epochs& epochs) {
  uint64_t appeared = 0, disappeared = 0, unstable = 0;
  const absl::Status compared = CompareSnapshots(*epochs.before, *epochs.after, [&](const BlockChange& change) {
    appeared += change.appeared.voxels.size();
    disappeared += change.disappeared.voxels.size();
    unstable += change.unstable.voxels.size();
    return absl::OkStatus();
  });
  if (!compared.ok()) return compared;
  return CountsJson(appeared, disappeared, unstable);
}

absl::StatusOr<std::string> Collect(const PageContext& context, const Epochs& epochs) {
  ChangedPoints points({.eta = context.config.stages.filter.eta});
  const absl::Status compared = CompareSnapshots(*epochs.before, *epochs.after, [&](const BlockChange& change) {
    points.Add(change.appeared, ChangeClass::kAppeared);
    points.Add(change.disappeared, ChangeClass::kDisappeared);
    points.Add(change.unstable, ChangeClass::kUnstable);
    return absl::OkStatus();
  });
  if (!compared.ok()) return compared;
  const auto tiles = context.tiles.Open(epochs.after->map().name, epochs.after->epoch());
  if (!tiles.ok()) return tiles.status();
  return points.Encode({.voxel_size = (*tiles)->voxel_size, .newest_day = (*tiles)->newest_day});
}

using Make = absl::StatusOr<std::string> (*)(const PageContext& context, const Epochs& epochs);

absl::StatusOr<PageResponse> Page(const PageContext& context, const PageRequest& request, const std::string& map,
                                  uint64_t before, uint64_t after, const char* content_type, uint64_t kind, Make make) {
  const auto epochs = OpenBoth(context, map, before, after);
  if (absl::IsFailedPrecondition(epochs.status())) {
    return ErrorPage(410, "FAILED_PRECONDITION", std::string(epochs.status().message()));
  }
  if (!epochs.ok()) return epochs.status();
  const ContentId id =
      ContentIdMaker().Add(kFormat).Add(epochs->after->map().incarnation).Add(before).Add(after).Add(kind).id();
  const Coding coding = request.range.empty() ? BestCoding(request.accept_encoding) : Coding::kIdentity;
  PageResponse page{.content_type = content_type, .etag = EntityTag(id.Hex(), coding), .keep = Keep::kForever};
  if (NamesTag(request.if_none_match, page.etag)) {
    page.status = 304;
    return page;
  }
  auto bytes = context.tiles.Keep(id, coding, [&] { return make(context, *epochs); });
  if (!bytes.ok()) return bytes.status();
  page.content_coding = NameOf(coding);
  page.body = *std::move(bytes);
  ApplyRange(request, page);
  return page;
}

}  // namespace

absl::StatusOr<PageResponse> ChangeCountsPage(const PageContext& context, const PageRequest& request,
                                              const std::string& map, uint64_t before, uint64_t after) {
  return Page(context, request, map, before, after, "application/json", 1,
              [](const PageContext&, const Epochs& epochs) { return Count(epochs); });
}

absl::StatusOr<PageResponse> ChangePointsPage(const PageContext& context, const PageRequest& request,
                                              const std::string& map, uint64_t before, uint64_t after) {
  return Page(context, request, map, before, after, "model/gltf-binary", 2, Collect);
}

}  // namespace mapkeep
