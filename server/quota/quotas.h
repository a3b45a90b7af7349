#pragma once

#include <absl/status/status.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "storage/session_store.h"

namespace mapkeep {

/// What one robot, or all robots of one map, may have under way. 0: no limit.
struct QuotaLimits {
  int64_t sessions = 0;  ///< begun and not committed
  int64_t jobs = 0;      ///< committed and not at their end: queued or running
  int64_t bytes = 0;     ///< of scans of either
};

/// The sessions under way as this daemon knows them, and whether there is room for more. Refusals are
/// RESOURCE_EXHAUSTED with a retry delay and name what is used up. A robot without a name has no quota of its own.
/// Thread-safe.
class Quotas {
 public:
  /// `refused` is told each time which quota it was: "robot_sessions", "map_bytes" and so on.
  Quotas(const QuotaLimits& robot, const QuotaLimits& map, std::chrono::milliseconds retry_delay,
         std::function<void(const std::string& quota)> refused = {});

  /// Before a session is begun: counts it, unless it is known already.
  absl::Status Begin(const std::string& map, const std::string& id, const std::string& robot);
  /// Before scans are staged: counts their bytes.
  absl::Status Append(const std::string& map, const std::string& id, uint64_t bytes);
  /// Before a session is queued: counts it as a job, unless it is one.
  absl::Status Queue(const SessionRecord& session);

  /// What a session's record is: counts it as that, or no longer.
  void Note(const SessionRecord& session);
  void Forget(const std::string& map, const std::string& id);
  void ForgetMap(std::string_view map);

  struct Use {
    int64_t sessions = 0, jobs = 0, bytes = 0;
  };
  /// Everything together.
  Use Total() const;

  using Key = std::pair<std::string, std::string>;  ///< map and session
  std::vector<Key> Known() const;

 private:
  struct Entry {
    std::string robot;
    bool is_job = false;
    int64_t bytes = 0;
  };

  absl::Status Room(const std::string& map, const std::string& robot, const Use& more) const;
  absl::Status Refuse(const char* of, std::string_view name, const char* what, int64_t limit) const;
  void Count(const std::string& map, const Entry& entry, int sign);
  void Drop(std::map<Key, Entry>::iterator entry);

  const QuotaLimits robot_limits_, map_limits_;
  const std::chrono::milliseconds retry_delay_;
  const std::function<void(const std::string&)> refused_;
  mutable std::mutex mutex_;
  std::map<Key, Entry> sessions_;
  std::map<std::string, Use, std::less<>> by_robot_, by_map_;
};

}  // namespace mapkeep
