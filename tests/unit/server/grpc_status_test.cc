#include "server/rpc/grpc_status.h"

#include <google/protobuf/any.pb.h>
#include <google/protobuf/descriptor.pb.h>
#include <google/protobuf/duration.pb.h>
#include <google/protobuf/dynamic_message.h>
#include <google/protobuf/text_format.h>
#include <gtest/gtest.h>

#include <string>

namespace mapkeep {
namespace {

using std::chrono::milliseconds;

// google/rpc/status.proto and error_details.proto, as their authors publish them.
std::string AsText(const std::string& type, const std::string& bytes) {
  google::protobuf::FileDescriptorProto file;
  EXPECT_TRUE(google::protobuf::TextFormat::ParseFromString(
      R"(name: "google/rpc/all.proto" package: "google.rpc" syntax: "proto3"
         dependency: "google/protobuf/any.proto" dependency: "google/protobuf/duration.proto"
         message_type { name: "Status"
           field { name: "code" number: 1 type: TYPE_INT32 label: LABEL_OPTIONAL }
           field { name: "message" number: 2 type: TYPE_STRING label: LABEL_OPTIONAL }
           field { name: "details" number: 3 type: TYPE_MESSAGE type_name: ".google.protobuf.Any" label: LABEL_REPEATED } }
         message_type { name: "RetryInfo"
           field { name: "retry_delay" number: 1 type: TYPE_MESSAGE type_name: ".google.protobuf.Duration" label: LABEL_OPTIONAL } })",
      &file));
  google::protobuf::DescriptorPool pool(google::protobuf::DescriptorPool::generated_pool());
  EXPECT_NE(google::protobuf::Any::descriptor(), google::protobuf::Duration::descriptor());
  const auto* built = pool.BuildFile(file);
  EXPECT_NE(built, nullptr);
  google::protobuf::DynamicMessageFactory factory(&pool);
  const std::unique_ptr<google::protobuf::Message> message(
      factory.GetPrototype(built->FindMessageTypeByName(type))->New());
  EXPECT_TRUE(message->ParseFromString(bytes));
  google::protobuf::TextFormat::Printer printer;
  printer.SetSingleLineMode(true);
  std::string text;
  printer.PrintToString(*message, &text);
  return text;
}

TEST(GrpcStatus, ARetryDelayIsWhatClientsOfGoogleRpcUnderstand) {
  const absl::Status error = WithRetryDelay(absl::ResourceExhaustedError("too much"), milliseconds(2500));
  const grpc::Status status = ToGrpc(error);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(status.error_message(), "too much");
  const std::string text = AsText("Status", status.error_details());
  EXPECT_NE(text.find(R"(code: 8 message: "too much")"), std::string::npos) << text;
  EXPECT_NE(text.find("type.googleapis.com/google.rpc.RetryInfo"), std::string::npos) << text;
  // The Any's bytes are those behind its type: field 2, a length, then RetryInfo.
  const std::string& details = status.error_details();
  const size_t url = details.find("RetryInfo");
  ASSERT_NE(url, std::string::npos);
  const std::string info = details.substr(url + std::string("RetryInfo").size() + 2);
  EXPECT_EQ(AsText("RetryInfo", info), "retry_delay { seconds: 2 nanos: 500000000 } ");
}

TEST(GrpcStatus, OtherErrorsKeepTheirDetails) {
  EXPECT_EQ(ToGrpc(absl::NotFoundError("x")).error_details(), "");
  EXPECT_EQ(ToGrpc(absl::OutOfRangeError("x"), "bytes").error_details(), "bytes");
  EXPECT_FALSE(RetryDelayOf(absl::NotFoundError("x")).has_value());
}

}  // namespace
}  // namespace mapkeep
