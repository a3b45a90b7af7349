#include "client/mapkeep/retry_delay.h"

#include <absl/strings/cord.h>
#include <absl/strings/match.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <google/protobuf/any.pb.h>
#include <google/protobuf/duration.pb.h>
#include <google/protobuf/unknown_field_set.h>

namespace mapkeep {
namespace {

constexpr char kPayload[] = "mapkeep/retry-delay-seconds";
constexpr int64_t kLongest = 3600;  // seconds: whoever says more is mistaken

using google::protobuf::UnknownField;
using google::protobuf::UnknownFieldSet;

/// Calls `found` with each field of that number that is a string of bytes. Debian has no google/rpc protos, so their
/// messages are read by number.
template <typename Found>
void ForEachField(const std::string& message, int number, const Found& found) {
  UnknownFieldSet fields;
  if (!fields.ParseFromString(message)) return;
  for (int i = 0; i < fields.field_count(); ++i) {
    const UnknownField& field = fields.field(i);
    if (field.number() == number && field.type() == UnknownField::TYPE_LENGTH_DELIMITED)
      found(field.length_delimited());
  }
}

}  // namespace

std::optional<absl::Duration> RetryDelayIn(const std::string& details) {
  std::optional<absl::Duration> delay;
  // google.rpc.Status { repeated Any details = 3; }, google.rpc.RetryInfo { Duration retry_delay = 1; }
  ForEachField(details, 3, [&delay](const std::string& detail) {
    google::protobuf::Any any;
    if (!any.ParseFromString(detail) || !absl::EndsWith(any.type_url(), "/google.rpc.RetryInfo")) return;
    ForEachField(any.value(), 1, [&delay](const std::string& bytes) {
      google::protobuf::Duration duration;
      if (!duration.ParseFromString(bytes) || duration.seconds() < 0 || duration.seconds() > kLongest) return;
      delay = absl::Seconds(duration.seconds()) + absl::Nanoseconds(duration.nanos());
    });
  });
  return delay;
}

absl::Status KeepRetryDelay(absl::Status status, absl::Duration delay) {
  status.SetPayload(kPayload, absl::Cord(absl::StrCat(absl::ToDoubleSeconds(delay))));
  return status;
}

std::optional<absl::Duration> KeptRetryDelay(const absl::Status& status) {
  const auto payload = status.GetPayload(kPayload);
  double seconds = 0;
  if (!payload || !absl::SimpleAtod(std::string(*payload), &seconds)) return std::nullopt;
  return absl::Seconds(seconds);
}

}  // namespace mapkeep
