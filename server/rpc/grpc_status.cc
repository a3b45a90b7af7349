#include "server/rpc/grpc_status.h"

#include <google/protobuf/any.pb.h>
#include <google/protobuf/duration.pb.h>
#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include <chrono>

namespace mapkeep {
namespace {

// Debian has no google/rpc protos, so their fields are written by hand: a tag is the number and 2 for "length follows".
constexpr uint32_t LengthDelimited(uint32_t field) { return field << 3 | 2; }

void AppendField(std::string& message, uint32_t field, const std::string& bytes) {
  google::protobuf::io::StringOutputStream stream(&message);
  google::protobuf::io::CodedOutputStream out(&stream);
  out.WriteTag(LengthDelimited(field));
  out.WriteVarint32(static_cast<uint32_t>(bytes.size()));
  out.WriteString(bytes);
}

// google.rpc.RetryInfo { Duration retry_delay = 1; }
std::string RetryInfo(std::chrono::milliseconds delay) {
  google::protobuf::Duration duration;
  duration.set_seconds(delay.count() / 1000);
  duration.set_nanos(static_cast<int32_t>(delay.count() % 1000 * 1'000'000));
  std::string info;
  AppendField(info, 1, duration.SerializeAsString());
  return info;
}

// google.rpc.Status { int32 code = 1; string message = 2; repeated Any details = 3; }
std::string StatusWithRetryInfo(const absl::Status& status, std::chrono::milliseconds delay) {
  google::protobuf::Any detail;
  detail.set_type_url("type.googleapis.com/google.rpc.RetryInfo");
  detail.set_value(RetryInfo(delay));
  std::string message;
  {
    google::protobuf::io::StringOutputStream stream(&message);
    google::protobuf::io::CodedOutputStream out(&stream);
    out.WriteTag(1 << 3);
    out.WriteVarint32(static_cast<uint32_t>(status.code()));
  }
  AppendField(message, 2, std::string(status.message()));
  AppendField(message, 3, detail.SerializeAsString());
  return message;
}

}  // namespace

grpc::Status ToGrpc(const absl::Status& status, const std::string& details) {
  const auto delay = RetryDelayOf(status);
  return {static_cast<grpc::StatusCode>(status.code()), std::string(status.message()),
          details.empty() && delay ? StatusWithRetryInfo(status, *delay) : details};
}

}  // namespace mapkeep
