#include "server/http/event_pages.h"

#include <absl/strings/str_cat.h>

#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <utility>

#include "server/http/event_stream.h"
#include "server/http/map_pages.h"

namespace mapkeep {
namespace {

// One client's watch of a map. The feeds only note what changed; the pool looks at the store and sends.
class MapEvents : public std::enable_shared_from_this<MapEvents> {
 public:
  MapEvents(const PageContext& context, std::string map, std::string seen)
      : context_(context), map_(std::move(map)), last_epoch_(std::move(seen)) {}

  ~MapEvents() {
    context_.feed.Unwatch(session_watcher_);
    context_.epochs.Unwatch(epoch_watcher_);
  }

  void Begin() {
    // The feeds may not hold it: it would go in a callback of theirs, and wait for them there.
    const auto note = [noted = noted_, weak = weak_from_this(), &pool = context_.pool](const std::string& session) {
      if (!noted->Add(session)) return;
      pool.Submit([weak] {
        if (const auto self = weak.lock()) self->Look();
      });
    };
    session_watcher_ = context_.feed.WatchMap(map_, note);
    epoch_watcher_ = context_.epochs.Watch(map_, [note] { note(""); });
    noted_->Add("");
    Look();
  }

  EventStream& stream() { return stream_; }

 private:
  // What changed since the last look.
  struct Noted {
    std::mutex mutex;
    std::set<std::string> sessions;
    bool any = false;

    // True if a look has to be asked for. An empty session stands for the epoch, which every look looks at.
    bool Add(const std::string& session) {
      const std::scoped_lock lock(mutex);
      if (!session.empty()) sessions.insert(session);
      return !std::exchange(any, true);
    }
    std::set<std::string> Take() {
      const std::scoped_lock lock(mutex);
      any = false;
      return std::exchange(sessions, {});
    }
  };

  void Look() {
    const std::scoped_lock one_at_a_time(looking_);
    const std::set<std::string> sessions = noted_->Take();
    if (!SendEpoch()) return stream_.End();
    for (const std::string& id : sessions) SendSession(id);
    if (context_.feed.closed() || context_.epochs.closed()) stream_.End();
  }

  // False if the map is gone.
  bool SendEpoch() {
    const auto newest = context_.maps.Versions(map_, std::nullopt, 1);
    if (absl::IsNotFound(newest.status())) return false;
    if (!newest.ok() || newest->empty()) return true;  // the next change looks again
    std::string epoch = absl::StrCat(newest->front().commit.epoch);
    const auto json = EpochJson(newest->front());
    if (epoch == last_epoch_ || !json.ok()) return true;
    stream_.Send("epoch", *json, epoch);
    last_epoch_ = std::move(epoch);
    return true;
  }

  void SendSession(const std::string& id) {
    const auto session = context_.sessions.Find(map_, id);
    if (!session.ok()) return;  // deleted
    const auto json = SessionJson(context_, *session);
    if (json.ok()) stream_.Send("session", *json);
  }

  const PageContext context_;
  const std::string map_;
  const std::shared_ptr<Noted> noted_ = std::make_shared<Noted>();
  SessionFeed::Watcher session_watcher_ = 0;
  EpochFeed::Watcher epoch_watcher_ = 0;
  std::mutex looking_;
  std::string last_epoch_;
  EventStream stream_;
};

}  // namespace

absl::StatusOr<PageResponse> EventsPage(const PageContext& context, const PageRequest& request,
                                        const std::string& map) {
  if (absl::Status status = context.maps.Find(map).status(); !status.ok()) return status;
  if (context.feed.closed()) return absl::UnavailableError("the daemon is stopping; come back");
  // Who comes back after a break need not hear again of the epoch that it heard of last.
  const auto events = std::make_shared<MapEvents>(context, map, request.last_event_id);
  events->Begin();
  return PageResponse{.content_type = "text/event-stream",
                      .headers = {{"X-Accel-Buffering", "no"}},
                      .events = std::shared_ptr<EventStream>(events, &events->stream())};
}

}  // namespace mapkeep
