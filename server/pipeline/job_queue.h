#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>

namespace mapkeep {

/// Why a job has to end early.
enum class StopReason {
  kNone,
  kHandBack,    ///< the daemon ends: the session stays unfinished and goes on at the next start
  kMapDeleted,  ///< there is nothing left to work for
  kLeaseLost,   ///< another daemon has it now
};

/// A session that waits for the pipeline or is at work there.
struct Job {
  using Time = std::chrono::steady_clock::time_point;

  std::string map, session;
  bool resumed = false;  ///< was at work when a daemon ended
  uint64_t turn = 0;     ///< of the session
  int troubles = 0;      ///< times in a row that the store's trouble put it off
  Time not_before;
  Time pushed = std::chrono::steady_clock::now();  ///< into this queue
  std::atomic<StopReason> stop = StopReason::kNone;

  Job(std::string map_name, std::string session_id, bool was_running, uint64_t session_turn)
      : map(std::move(map_name)), session(std::move(session_id)), resumed(was_running), turn(session_turn) {}
};

/// How long the line is.
struct JobQueueStatus {
  size_t waiting = 0, at_work = 0;
  double oldest_seconds = 0;  ///< since the one that waits longest was pushed; 0: none waits
};

/// Sessions to be merged, one at a time a map: two of one map would only race for its head, and the loser would merge
/// again. They come by their turns, the order of CommitSession, so that a restart finds the same order. Thread-safe.
class JobQueue {
 public:
  /// Does nothing if the session is waiting or at work already, or if the queue is closed.
  void Push(std::string map, std::string session, bool resumed, uint64_t turn);

  /// The next job of a map that has none at work, of those that are not put off; waits for one. nullptr once the queue
  /// is closed.
  std::shared_ptr<Job> Take();

  /// The job is over: the next of its map may be taken.
  void Done(const Job& job);

  /// The job taken is not over: it comes again, after a pause. Its map is free meanwhile.
  void PutOff(const std::shared_ptr<Job>& job, std::chrono::milliseconds pause);

  /// Drops the map's waiting jobs, stops the one at work and waits until it is done.
  void StopMap(std::string_view map, StopReason reason);

  JobQueueStatus Status() const;

  /// Take gives nothing from now on; jobs at work are told to stop for `reason`. Does not wait.
  void Close(StopReason reason);

 private:
  using Order = std::tuple<uint64_t, std::string, std::string>;  // by turn, then map and session

  static Order OrderOf(const Job& job) { return {job.turn, job.map, job.session}; }

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  bool closed_ = false;
  std::map<Order, std::shared_ptr<Job>> waiting_;
  std::map<std::string, std::shared_ptr<Job>, std::less<>> at_work_;  // by map
  std::set<std::pair<std::string, std::string>> known_;               // map and session of both
};

}  // namespace mapkeep
