#pragma once

#include <absl/time/clock.h>
#include <absl/time/time.h>

namespace mapkeep {

/// How long to go on trying: waits between attempts, longer each time, until `seconds` have passed without progress.
class Patience {
 public:
  explicit Patience(double seconds) : limit_(absl::Seconds(seconds)), last_progress_(absl::Now()) {}

  /// Something was achieved: the time begins anew.
  void Renew();

  /// Waits for the next attempt, at least as long as the server asked for; false if the time is up.
  bool Wait(absl::Duration at_least = absl::ZeroDuration());

 private:
  static constexpr absl::Duration kShortest = absl::Milliseconds(100);
  static constexpr absl::Duration kLongest = absl::Seconds(2);

  absl::Duration limit_;
  absl::Time last_progress_;
  absl::Duration pause_ = kShortest;
};

}  // namespace mapkeep
