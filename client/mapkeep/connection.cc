#include "client/mapkeep/connection.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/time/clock.h>

#include <algorithm>
#include <string>

#include "client/mapkeep/channel.h"
#include "client/mapkeep/retry_delay.h"

namespace mapkeep {

namespace {

// A proxy whose server went away resets the stream or the connection, which gRPC takes for an internal error, for a
// cancellation or for something that it does not know.
bool BrokeOff(const grpc::Status& status) {
  const std::string& message = status.error_message();
  switch (status.error_code()) {
    case grpc::StatusCode::UNKNOWN:
      return absl::StrContains(message, "Stream removed");
    case grpc::StatusCode::INTERNAL:
    case grpc::StatusCode::CANCELLED:
      return absl::StrContains(message, "RST_STREAM");
    default:
      return false;
  }
}

}  // namespace

Connection::Connection(const ClientOptions& options)
    : options_(options),
      usable_(CheckCredentials(options)),
      channel_(MakeChannel(usable_.ok() ? options : ClientOptions{.server = options.server})),
      admin_(v1::AdminService::NewStub(channel_)),
      maps_(v1::MapService::NewStub(channel_)),
      sessions_(v1::SessionService::NewStub(channel_)),
      tiles_(v1::TileService::NewStub(channel_)),
      localization_(v1::LocalizationService::NewStub(channel_)) {}

absl::Status Connection::WaitForServer() const {
  if (!usable_.ok()) return usable_;
  if (channel_->WaitForConnected(absl::ToChronoTime(absl::Now() + absl::Seconds(options_.connect_seconds)))) {
    return absl::OkStatus();
  }
  return absl::UnavailableError(
      absl::StrFormat("no mapkeepd answers at %s (waited %g s)", options_.server, options_.connect_seconds));
}

absl::Status Connection::StatusOf(const grpc::Status& status) const {
  if (status.ok()) return absl::OkStatus();
  // The two libraries number their codes alike.
  const auto code =
      BrokeOff(status) ? absl::StatusCode::kUnavailable : static_cast<absl::StatusCode>(status.error_code());
  if (const auto delay = RetryDelayIn(status.error_details())) {
    return KeepRetryDelay({code, status.error_message()}, *delay);
  }
  if (code != absl::StatusCode::kUnavailable) return {code, status.error_message()};
  return {code, absl::StrCat("the server at ", options_.server, " is not available: ", status.error_message())};
}

void Patience::Renew() {
  last_progress_ = absl::Now();
  pause_ = kShortest;
}

bool Patience::Wait(absl::Duration at_least) {
  const absl::Duration pause = std::max(pause_, at_least);
  if (absl::Now() - last_progress_ + pause > limit_) return false;
  absl::SleepFor(pause);
  pause_ = std::min(2 * pause_, kLongest);
  return true;
}

}  // namespace mapkeep
