#include "client/mapkeep/connection.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/time/clock.h>

#include <algorithm>
#include <string>

namespace mapkeep {
namespace {

constexpr int kLargestMessage = 8 << 20;  // bytes, as the server's

std::shared_ptr<grpc::Channel> MakeChannel(const std::string& server) {
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(kLargestMessage);
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 100);
  arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, 1000);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 2000);
  // A peer that vanished without a word is noticed within 40 s; the server allows pings every 10 s.
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, 30000);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 10000);
  // Robots speak to their own server: a proxy from the environment is for the web.
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  return grpc::CreateCustomChannel(server, grpc::InsecureChannelCredentials(), arguments);
}

}  // namespace

Connection::Connection(const ClientOptions& options)
    : options_(options),
      channel_(MakeChannel(options.server)),
      admin_(v1::AdminService::NewStub(channel_)),
      maps_(v1::MapService::NewStub(channel_)),
      sessions_(v1::SessionService::NewStub(channel_)),
      tiles_(v1::TileService::NewStub(channel_)),
      localization_(v1::LocalizationService::NewStub(channel_)) {}

absl::Status Connection::WaitForServer() const {
  if (channel_->WaitForConnected(absl::ToChronoTime(absl::Now() + absl::Seconds(options_.connect_seconds)))) {
    return absl::OkStatus();
  }
  return absl::UnavailableError(
      absl::StrFormat("no mapkeepd answers at %s (waited %g s)", options_.server, options_.connect_seconds));
}

absl::Status Connection::StatusOf(const grpc::Status& status) const {
  if (status.ok()) return absl::OkStatus();
  // The two libraries number their codes alike.
  const auto code = static_cast<absl::StatusCode>(status.error_code());
  if (code != absl::StatusCode::kUnavailable) return {code, status.error_message()};
  return {code, absl::StrCat("the server at ", options_.server, " is not available: ", status.error_message())};
}

void Patience::Renew() {
  last_progress_ = absl::Now();
  pause_ = kShortest;
}

bool Patience::Wait() {
  if (absl::Now() - last_progress_ + pause_ > limit_) return false;
  absl::SleepFor(pause_);
  pause_ = std::min(2 * pause_, kLongest);
  return true;
}

}  // namespace mapkeep
