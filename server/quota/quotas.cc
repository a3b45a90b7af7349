#include "server/quota/quotas.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include "server/retry_delay.h"

namespace mapkeep {
namespace {

bool IsUnderWay(SessionState state) { return !HasEnded(state); }

}  // namespace

Quotas::Quotas(const QuotaLimits& robot, const QuotaLimits& map, std::chrono::milliseconds retry_delay,
               std::function<void(const std::string&)> refused)
    : robot_limits_(robot), map_limits_(map), retry_delay_(retry_delay), refused_(std::move(refused)) {}

absl::Status Quotas::Begin(const std::string& map, const std::string& id, const std::string& robot) {
  const std::lock_guard lock(mutex_);
  if (sessions_.contains({map, id})) return absl::OkStatus();
  if (absl::Status status = Room(map, robot, {.sessions = 1}); !status.ok()) return status;
  const Entry& entry = sessions_.emplace(Key(map, id), Entry{robot}).first->second;
  Count(map, entry, 1);
  return absl::OkStatus();
}

absl::Status Quotas::Append(const std::string& map, const std::string& id, uint64_t bytes) {
  const std::lock_guard lock(mutex_);
  const auto found = sessions_.find({map, id});
  if (found == sessions_.end()) return absl::OkStatus();  // deleted meanwhile: the store will say so
  const auto more = static_cast<int64_t>(bytes);
  if (absl::Status status = Room(map, found->second.robot, {.bytes = more}); !status.ok()) return status;
  Count(map, found->second, -1);
  found->second.bytes += more;
  Count(map, found->second, 1);
  return absl::OkStatus();
}

absl::Status Quotas::Queue(const SessionRecord& session) {
  const std::lock_guard lock(mutex_);
  const auto found = sessions_.find({session.map, session.id});
  if (found != sessions_.end() && found->second.is_job) return absl::OkStatus();
  if (absl::Status status = Room(session.map, session.robot, {.jobs = 1}); !status.ok()) return status;
  if (found != sessions_.end()) {
    Count(session.map, found->second, -1);
    found->second.is_job = true;
    Count(session.map, found->second, 1);
  } else {
    const Entry entry{session.robot, true, static_cast<int64_t>(session.staged_bytes)};
    Count(session.map, sessions_.emplace(Key(session.map, session.id), entry).first->second, 1);
  }
  return absl::OkStatus();
}

void Quotas::Note(const SessionRecord& session) {
  const std::lock_guard lock(mutex_);
  const auto found = sessions_.find({session.map, session.id});
  if (found != sessions_.end()) Drop(found);
  if (!IsUnderWay(session.state)) return;
  const Entry entry{session.robot, session.state != SessionState::kUploading,
                    static_cast<int64_t>(session.staged_bytes)};
  Count(session.map, sessions_.emplace(Key(session.map, session.id), entry).first->second, 1);
}

void Quotas::Forget(const std::string& map, const std::string& id) {
  const std::lock_guard lock(mutex_);
  if (const auto found = sessions_.find({map, id}); found != sessions_.end()) Drop(found);
}

void Quotas::ForgetMap(std::string_view map) {
  const std::lock_guard lock(mutex_);
  for (auto entry = sessions_.lower_bound({std::string(map), ""}); entry != sessions_.end();) {
    const auto next = std::next(entry);
    if (entry->first.first != map) break;
    Drop(entry);
    entry = next;
  }
}

Quotas::Use Quotas::Total() const {
  const std::lock_guard lock(mutex_);
  Use total;
  for (const auto& [map, use] : by_map_) {
    total.sessions += use.sessions;
    total.jobs += use.jobs;
    total.bytes += use.bytes;
  }
  return total;
}

std::vector<Quotas::Key> Quotas::Known() const {
  const std::lock_guard lock(mutex_);
  std::vector<Key> keys;
  for (const auto& [key, entry] : sessions_) keys.push_back(key);
  return keys;
}

absl::Status Quotas::Room(const std::string& map, const std::string& robot, const Use& more) const {
  const auto check = [&](const char* of, const std::string& name, const std::map<std::string, Use, std::less<>>& uses,
                         const QuotaLimits& limits) -> absl::Status {
    const auto found = uses.find(name);
    const Use use = found == uses.end() ? Use() : found->second;
    if (more.sessions > 0 && limits.sessions > 0 && use.sessions + more.sessions > limits.sessions) {
      return Refuse(of, name, "sessions", limits.sessions);
    }
    if (more.jobs > 0 && limits.jobs > 0 && use.jobs + more.jobs > limits.jobs) {
      return Refuse(of, name, "jobs", limits.jobs);
    }
    if (more.bytes > 0 && limits.bytes > 0 && use.bytes + more.bytes > limits.bytes) {
      return Refuse(of, name, "bytes", limits.bytes);
    }
    return absl::OkStatus();
  };
  if (!robot.empty()) {
    if (absl::Status status = check("robot", robot, by_robot_, robot_limits_); !status.ok()) return status;
  }
  return check("map", map, by_map_, map_limits_);
}

absl::Status Quotas::Refuse(const char* of, std::string_view name, const char* what, int64_t limit) const {
  const std::string quota = absl::StrCat(of, "_", what);
  if (refused_) refused_(quota);
  return WithRetryDelay(
      absl::ResourceExhaustedError(absl::StrFormat(
          "%s %s is at its quota of %d %s under way (quota.%s); try again in %d s", of, std::string(name), limit, what,
          quota, std::chrono::duration_cast<std::chrono::seconds>(retry_delay_).count())),
      retry_delay_);
}

void Quotas::Count(const std::string& map, const Entry& entry, int sign) {
  const auto count = [&](std::map<std::string, Use, std::less<>>& uses, const std::string& name) {
    Use& use = uses[name];
    (entry.is_job ? use.jobs : use.sessions) += sign;
    use.bytes += sign * entry.bytes;
    if (use.sessions == 0 && use.jobs == 0 && use.bytes == 0) uses.erase(name);
  };
  count(by_map_, map);
  if (!entry.robot.empty()) count(by_robot_, entry.robot);
}

void Quotas::Drop(std::map<Key, Entry>::iterator entry) {
  Count(entry->first.first, entry->second, -1);
  sessions_.erase(entry);
}

}  // namespace mapkeep
