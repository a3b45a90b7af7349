#pragma once

#include <condition_variable>
#include <mutex>
#include <thread>

#include "server/auth/authority.h"
#include "server/auth/certificates.h"

namespace mapkeep {

/// Looks every second whether the files of tokens and certificates changed, and has them read again; a file that
/// cannot be used is logged, and what was read last stays in force.
class CredentialWatch {
 public:
  /// Both outlive it; nullptr: no certificates.
  CredentialWatch(Authority& authority, Certificates* certificates);

 private:
  void Look();

  Authority& authority_;
  Certificates* const certificates_;
  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::jthread thread_;
};

}  // namespace mapkeep
