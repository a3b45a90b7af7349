#pragma once

#include <deque>
#include <string>

#include "client/mapkeep/client.h"

namespace mapkeep {

/// What an upload's progress looks like: "[=====>    ] 52 %, 41 of 78 scans, 8.1 MB/s, 0:05 left". Rate and remaining
/// time are those of the last ten seconds.
class UploadBar {
 public:
  /// The line for `now`, seconds on any clock that does not go back.
  std::string Line(const UploadProgress& progress, double now);

 private:
  struct Sample {
    double time = 0;
    uint32_t scans = 0;
    uint64_t bytes = 0;
  };
  std::deque<Sample> samples_;
};

}  // namespace mapkeep
