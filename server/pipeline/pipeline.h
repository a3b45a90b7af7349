#pragma once

#include <absl/status/status.h>

#include <memory>
#include <string>
#include <string_view>

#include "server/config.h"
#include "server/pipeline/run_session.h"

namespace mapkeep {

struct PipelineOptions {
  int threads = 0;              ///< of the parallel loops; 0: all cores
  int jobs = 1;                 ///< sessions at work at a time, each of another map
  bool serial_per_map = false;  ///< a map's sessions end in the order of CommitSession, whatever daemon they are on
  double lease_seconds = 30;
  std::string holder;  ///< this daemon's name on leases; the same after a restart
  StageParameters stages;
};

/// Worker threads that take queued sessions through the stages, each under a lease that is renewed meanwhile.
class Pipeline {
 public:
  Pipeline(const PipelineStores& stores, PipelineOptions options);
  /// Hands back what is at work (see Close) and waits for the threads.
  ~Pipeline();

  /// Queues every session that a daemon left unfinished, and forgets those whose map is gone.
  absl::Status ResumeUnfinished();

  /// Queues a session in state queued.
  void Push(const SessionRecord& session);

  JobQueueStatus Status() const;

  /// Ends the map's jobs without a result and returns when none is left.
  void StopMap(std::string_view map);

  /// No further jobs; those at work end as soon as their stage lets go, for the next start to resume. Does not wait.
  void Close();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace mapkeep
