#include "server/credential_watch.h"

#include <chrono>
#include <string>

#include "server/log.h"

namespace mapkeep {
namespace {

constexpr std::chrono::seconds kPause{1};

void Tell(const char* what, const absl::StatusOr<bool>& reloaded) {
  if (!reloaded.ok()) {
    LogError("credentials not read again", {{"what", what}, {"why", std::string(reloaded.status().message())}});
  } else if (*reloaded) {
    LogInfo("credentials read again", {{"what", what}});
  }
}

}  // namespace

CredentialWatch::CredentialWatch(Authority& authority, Certificates* certificates)
    : authority_(authority), certificates_(certificates), thread_([this](const std::stop_token& stop) {
        std::unique_lock lock(mutex_);
        while (!stop.stop_requested()) {
          changed_.wait_for(lock, stop, kPause, [] { return false; });
          Look();
        }
      }) {}

void CredentialWatch::Look() {
  Tell("tokens", authority_.Reload());
  if (certificates_ != nullptr) Tell("certificates", certificates_->Reload());
}

}  // namespace mapkeep
