#include "server/rpc/watch.h"

#include <functional>
#include <memory>
#include <string>
#include <utility>

#include "server/rpc/convert.h"
#include "server/rpc/sessions.h"
#include "server/rpc/watch_stream.h"

namespace mapkeep {
namespace {

class SessionLook {
 public:
  SessionLook(const ServiceContext& context, Call call)
      : context_(context), call_(std::move(call)), session_(call_.map, call_.session) {}

  Seen operator()(v1::WatchSessionResponse& response) {
    const auto session = FindSession(context_, call_, Access::kFollow, session_.first, session_.second);
    const bool closed = context_.feed.closed();
    const auto progress = context_.feed.Progress(session_);
    if (!session.ok()) return {.end = session.status()};
    *response.mutable_session() = ToProto(*session, progress);
    std::string now = response.SerializeAsString();
    Seen seen{.news = now != told_};  // whoever looks elsewhere finds the same most of the time
    told_ = std::move(now);
    if (HasEnded(session->state)) {
      seen.end = absl::OkStatus();
    } else if (closed) {
      seen.end = absl::UnavailableError("the daemon is stopping; watch again");
    }
    return seen;
  }

 private:
  const ServiceContext context_;
  const Call call_;
  const SessionFeed::Key session_;
  std::string told_;  // the last one, as bytes
};

}  // namespace

grpc::ServerWriteReactor<v1::WatchSessionResponse>* NewWatch(const ServiceContext& context, Call call) {
  const auto follow = [&context, key = SessionFeed::Key(call.map, call.session)](std::function<void()> changed) {
    const SessionFeed::Watcher watcher = context.feed.Watch(key, std::move(changed));
    return [&feed = context.feed, watcher] { feed.Unwatch(watcher); };
  };
  auto look = std::make_shared<SessionLook>(context, std::move(call));
  return WatchStream<v1::WatchSessionResponse>::Start(
      context, follow, [look](v1::WatchSessionResponse& response) { return (*look)(response); });
}

}  // namespace mapkeep
