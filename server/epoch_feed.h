#pragma once

#include <absl/container/flat_hash_map.h>

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>

#include "storage/map_store.h"

namespace mapkeep {

/// Tells those who watch a map that its newest epoch has changed, whoever committed it: another daemon on the same
/// store, too. Looks at each watched map's head once a period, however many watch it. Thread-safe.
class EpochFeed {
 public:
  using Watcher = uint64_t;

  /// `maps` outlives it.
  explicit EpochFeed(const MapStore& maps, std::chrono::milliseconds period = std::chrono::milliseconds(250));
  ~EpochFeed();
  EpochFeed(const EpochFeed&) = delete;
  EpochFeed& operator=(const EpochFeed&) = delete;

  /// `changed` is called after the map got another epoch, was deleted or made anew, and once if the feed closes;
  /// changes in one period are one. What was before the first look is not told: look yourself after this returns. It
  /// must not block nor call the feed.
  Watcher Watch(std::string map, std::function<void()> changed);
  /// `changed` is not running and will not be called again once this returns.
  void Unwatch(Watcher watcher);

  /// The daemon ends: watchers are told, and find the feed closed.
  void Close();
  bool closed() const;

 private:
  struct Entry {
    std::string map;
    std::function<void()> changed;
  };
  void Run();
  void Look(const std::string& map);

  const MapStore& maps_;
  const std::chrono::milliseconds period_;
  mutable std::mutex mutex_;
  std::condition_variable ending_;
  bool closed_ = false;
  Watcher last_ = 0;
  std::map<Watcher, Entry> watchers_;
  absl::flat_hash_map<std::string, MapHead> seen_;  ///< of watched maps; a map that is not there: zeros
  std::jthread thread_;
};

}  // namespace mapkeep
