#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

namespace mapkeep {

/// Where the pipeline is with a session.
struct StageProgress {
  std::string stage;
  double fraction = 0;  ///< of that stage, [0, 1]
};

/// Tells those who watch a session that it changed, and keeps the progress of the sessions at work, which is not worth
/// storing. Thread-safe.
class SessionFeed {
 public:
  using Key = std::pair<std::string, std::string>;  ///< map and session
  using Watcher = uint64_t;

  /// `changed` is called after every change, and once if the feed closes; it must not block nor call the feed.
  Watcher Watch(Key session, std::function<void()> changed);
  /// Likewise for every session of a map, with the id of the one that changed, empty when the feed closes.
  Watcher WatchMap(std::string map, std::function<void(const std::string& session)> changed);
  /// `changed` is not running and will not be called again once this returns.
  void Unwatch(Watcher watcher);

  /// The session's record changed.
  void Changed(const Key& session);
  /// Told to the watchers when the stage changes or another hundredth is done.
  void SetProgress(const Key& session, StageProgress progress);
  /// No longer at work.
  void ClearProgress(const Key& session);
  std::optional<StageProgress> Progress(const Key& session) const;

  /// Another daemon may have changed what is not at work here: its watchers look again.
  void LookElsewhere();

  /// The daemon ends: watchers are told, and find the feed closed.
  void Close();
  bool closed() const;

 private:
  void Tell(const Key& session) const;  // with the mutex held

  mutable std::mutex mutex_;
  bool closed_ = false;
  Watcher last_ = 0;
  std::map<Watcher, std::pair<Key, std::function<void()>>> watchers_;
  std::map<Watcher, std::pair<std::string, std::function<void(const std::string&)>>> map_watchers_;
  std::map<Key, StageProgress> progress_;
};

}  // namespace mapkeep
