#pragma once

namespace mapkeep {

/// While it lives, the first Ctrl-C (or SIGTERM) only sets a mark, so that the work can stop in order; the second one
/// ends the process as usual. One at a time.
class Interruption {
 public:
  Interruption();
  ~Interruption();
  Interruption(const Interruption&) = delete;
  Interruption& operator=(const Interruption&) = delete;

  bool requested() const;
};

}  // namespace mapkeep
