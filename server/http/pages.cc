#include "server/http/pages.h"

#include <absl/strings/str_cat.h>

#include <memory>
#include <optional>
#include <utility>

#include "server/http/change_pages.h"
#include "server/http/event_pages.h"
#include "server/http/map_pages.h"
#include "server/http/tile_pages.h"
#include "server/log.h"
#include "server/names.h"

namespace mapkeep {
namespace {

PageResponse NoSuchPage() { return ErrorPage(absl::NotFoundError("there is no such page")); }

PageResponse Refusal(const absl::Status& status, const std::string& map) {
  LogWarning("page refused", {{"map", map}, {"why", std::string(status.message())}});
  PageResponse page = ErrorPage(status);
  if (page.status == 401) page.headers.emplace_back("WWW-Authenticate", "Bearer");
  return page;
}

std::string Bearer(const PageRequest& request) {
  return request.token.empty() ? std::string() : absl::StrCat("Bearer ", request.token);
}

// The number of an epoch in a path.
std::optional<uint64_t> EpochOf(const std::string& segment) { return WholeNumber(segment); }

}  // namespace

void Pages::Answer(Respond respond, Work work) const {
  context_.pool.Submit([respond = std::move(respond), work = std::move(work)] {
    auto page = work();
    respond(page.ok() ? *std::move(page) : ErrorPage(page.status()));
  });
}

void Pages::Handle(PageRequest request, Respond respond) const {
  const std::vector<std::string>& path = request.target.path;
  if (path.empty()) return respond(context_.assets.Find(request, {"index.html"}));
  if (path[0] == "viewer") {
    const bool only = path.size() == 1;
    return respond(context_.assets.Find(request, only ? std::vector<std::string>{"index.html"}
                                                      : std::vector<std::string>(path.begin() + 1, path.end())));
  }
  if (path.size() < 2 || path[0] != "v1" || path[1] != "maps") return respond(NoSuchPage());
  if (path.size() > 2) return HandleMap(std::move(request), std::move(respond));
  const auto caller = context_.authority.Authorize(Bearer(request), Access::kRead, Scope::Any());
  if (!caller.ok()) return respond(Refusal(caller.status(), ""));
  Answer(std::move(respond), [this, caller = *caller, target = std::move(request.target)] {
    return ListMapsPage(context_, caller, target);
  });
}

void Pages::HandleMap(PageRequest request, Respond respond) const {
  const std::vector<std::string>& path = request.target.path;
  const std::string map = path[2], what = path.size() > 3 ? path[3] : "";
  const size_t parts = path.size();
  if (absl::Status status = CheckName("map name", map); !status.ok()) return respond(ErrorPage(status));
  const auto caller = context_.authority.Authorize(Bearer(request), Access::kRead, Scope::Map(map));
  if (!caller.ok()) return respond(Refusal(caller.status(), map));
  const RequestTarget& target = request.target;
  if (parts == 3) return Answer(std::move(respond), [this, map] { return MapPage(context_, map); });
  if (what == "epochs" && parts == 4) {
    return Answer(std::move(respond), [this, map, target] { return EpochsPage(context_, map, target); });
  }
  if (what == "epochs" || what == "latest") return HandleEpoch(std::move(request), std::move(respond));
  if (what == "sessions" && parts == 4) {
    return Answer(std::move(respond), [this, map, target] { return SessionsPage(context_, map, target); });
  }
  if (what == "sessions" && parts == 5) {
    return Answer(std::move(respond), [this, map, id = path[4]] { return SessionPage(context_, map, id); });
  }
  if (what == "sessions" && parts == 6 && path[5] == "poses") {
    return Answer(std::move(respond),
                  [this, map, id = path[4], target] { return PosesPage(context_, map, id, target); });
  }
  if (what == "voxel" && parts == 4) {
    return Answer(std::move(respond), [this, map, target] { return VoxelPage(context_, map, target); });
  }
  if (what == "events" && parts == 4) {
    return Answer(std::move(respond),
                  [this, map, request = std::move(request)] { return EventsPage(context_, request, map); });
  }
  if (what == "changes" && (parts == 6 || (parts == 7 && path[6] == "points.glb"))) {
    const auto before = EpochOf(path[4]), after = EpochOf(path[5]);
    if (!before || !after) {
      return respond(ErrorPage(absl::InvalidArgumentError("changes: expected the numbers of two epochs")));
    }
    return Answer(std::move(respond),
                  [this, map, before = *before, after = *after, points = parts == 7, request = std::move(request)] {
                    return points ? ChangePointsPage(context_, request, map, before, after)
                                  : ChangeCountsPage(context_, request, map, before, after);
                  });
  }
  respond(NoSuchPage());
}

void Pages::HandleEpoch(PageRequest request, Respond respond) const {
  const std::vector<std::string>& path = request.target.path;
  const std::string map = path[2];
  const bool latest = path[3] == "latest";
  const size_t rest = latest ? 4 : 5;  // where the path goes on
  std::optional<uint64_t> epoch;
  if (!latest) {
    epoch = EpochOf(path[4]);
    if (!epoch) return respond(ErrorPage(absl::InvalidArgumentError("epochs: expected the number of an epoch")));
  }
  if (path.size() == rest + 1 && path[rest] == "tileset.json") {
    return Answer(std::move(respond), [this, map, epoch, request = std::move(request)] {
      return TilesetPage(context_, request, map, epoch);
    });
  }
  if (!epoch || path.size() != rest + 2 || path[rest] != "tiles") return respond(NoSuchPage());
  const std::string file = path[rest + 1];
  // Most tiles are in memory: those need no thread but this one.
  if (auto known = TileFilePage(context_, request, map, *epoch, file, true)) {
    return respond(known->ok() ? **std::move(known) : ErrorPage(known->status()));
  }
  Answer(std::move(respond), [this, map, epoch = *epoch, file, request = std::move(request)] {
    return *TileFilePage(context_, request, map, epoch, file, false);
  });
}

}  // namespace mapkeep
