#include "server/rpc/map_watch.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_split.h>

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/names.h"
#include "server/rpc/paging.h"
#include "server/rpc/watch_stream.h"

namespace mapkeep {
namespace {

// Farther back, reading every commit takes longer than comparing tiles.
constexpr uint64_t kMostEpochsBehind = 1000;

std::string TokenOf(const MapHead& head) { return PageToken(absl::StrFormat("%x.%d", head.incarnation, head.epoch)); }

absl::StatusOr<MapHead> HeadOf(const std::string& token) {
  const absl::Status bad = absl::InvalidArgumentError("resume_token: expected one from an earlier answer");
  const absl::StatusOr<std::string> position = PositionOf(token);
  if (!position.ok()) return bad;
  const std::vector<std::string> parts = absl::StrSplit(*position, '.');
  MapHead head;
  if (parts.size() != 2 || !absl::SimpleHexAtoi(parts[0], &head.incarnation) ||
      !absl::SimpleAtoi(parts[1], &head.epoch)) {
    return bad;
  }
  return head;
}

// Tells the next epoch that there is to tell.
class MapLook {
 public:
  MapLook(const ServiceContext& context, const v1::WatchMapRequest& request)
      : context_(context), map_(request.map()), token_(request.resume_token()) {}

  Seen operator()(v1::WatchMapResponse& response) {
    const absl::StatusOr<bool> news = NextMessage(response);
    const bool closed = context_.epochs.closed();
    if (!news.ok()) return {.end = news.status()};
    Seen seen{.news = *news, .more = *news};
    if (closed) seen.end = absl::UnavailableError("the daemon is stopping; watch again");
    return seen;
  }

 private:
  // False if everything was told.
  absl::StatusOr<bool> NextMessage(v1::WatchMapResponse& response) {
    if (!at_) {
      if (absl::Status status = CheckName("map name", map_); !status.ok()) return status;
      const absl::StatusOr<MapHead> from = token_.empty() ? MapHead() : HeadOf(token_);
      if (!from.ok()) return from.status();
      at_ = *from;
    }
    const absl::StatusOr<MapHead> head = context_.maps.Head(map_);
    if (!head.ok()) return head.status();
    if (*head == *at_) return false;
    response.Clear();
    if (head->incarnation != at_->incarnation || head->epoch < at_->epoch ||
        head->epoch - at_->epoch > kMostEpochsBehind) {
      response.set_any_tile(true);
      response.set_epoch(head->epoch);
      at_ = *head;
      response.set_resume_token(TokenOf(*at_));
      return true;
    }
    const auto commits = context_.maps.CommitsAfter(map_, *at_, 1);
    if (!commits.ok()) return commits.status();
    if (commits->empty()) return false;
    const CommitRecord& commit = commits->front();
    response.set_epoch(commit.epoch);
    response.set_session(commit.session);
    response.set_rollback(commit.rollback);
    for (const TileKey key : commit.touched_tiles) {
      const VoxelIndex tile = TileIndexOf(key);
      v1::TileId& id = *response.add_touched_tiles();
      id.set_x(tile.x);
      id.set_y(tile.y);
    }
    at_->epoch = commit.epoch;
    response.set_resume_token(TokenOf(*at_));
    return true;
  }

  const ServiceContext context_;
  const std::string map_, token_;
  std::optional<MapHead> at_;  // what was told last
};

}  // namespace

grpc::ServerWriteReactor<v1::WatchMapResponse>* NewMapWatch(const ServiceContext& context,
                                                            const v1::WatchMapRequest& request) {
  const auto follow = [&context, &request](std::function<void()> changed) {
    const EpochFeed::Watcher watcher = context.epochs.Watch(request.map(), std::move(changed));
    return [&epochs = context.epochs, watcher] { epochs.Unwatch(watcher); };
  };
  auto look = std::make_shared<MapLook>(context, request);
  return WatchStream<v1::WatchMapResponse>::Start(context, follow,
                                                  [look](v1::WatchMapResponse& response) { return (*look)(response); });
}

}  // namespace mapkeep
