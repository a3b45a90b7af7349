#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <google/protobuf/message_lite.h>

#include <string>
#include <string_view>

namespace mapkeep {

// How rows and tree nodes are stored (checksum little-endian, over the message):
//
//   record := 'R' version:u8 checksum:u32 message
//   version := 1
//   message := one Protobuf message of records.proto

/// The bytes of a record. The same message gives the same bytes.
std::string EncodeRecord(const google::protobuf::MessageLite& message);

/// Reads `record` into `message`; DATA_LOSS naming `what` if it is damaged.
absl::Status DecodeRecordInto(std::string_view record, std::string_view what, google::protobuf::MessageLite& message);

template <typename Message>
absl::StatusOr<Message> DecodeRecord(std::string_view record, std::string_view what) {
  Message message;
  if (absl::Status status = DecodeRecordInto(record, what, message); !status.ok()) return status;
  return message;
}

}  // namespace mapkeep
