#include "storage/record_codec.h"

#include "core/checksum/crc32c.h"
#include "storage/byte_planes.h"
#include "storage/text.h"

namespace mapkeep {
namespace {

constexpr char kMagic = 'R';
constexpr char kVersion = 1;
constexpr size_t kChecksumAt = 2, kMessageAt = 6;

}  // namespace

std::string EncodeRecord(const google::protobuf::MessageLite& message) {
  const std::string bytes = message.SerializeAsString();
  std::string record;
  record.reserve(kMessageAt + bytes.size());
  record.push_back(kMagic);
  record.push_back(kVersion);
  AppendNumber<4>(record, Crc32c(bytes));
  record.append(bytes);
  return record;
}

absl::Status DecodeRecordInto(std::string_view record, std::string_view what, google::protobuf::MessageLite& message) {
  const auto damaged = [what](std::string_view why) { return absl::DataLossError(Text(what, ": ", why)); };
  if (record.size() < kMessageAt || record[0] != kMagic) return damaged("this is not a record");
  if (record[1] != kVersion) return damaged(Text("format version ", int{record[1]}, ", known is 1"));
  const std::string_view bytes = record.substr(kMessageAt);
  if (NumberAt<4>(record.data() + kChecksumAt) != Crc32c(bytes)) return damaged("the checksum does not match");
  if (!message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) return damaged("it cannot be parsed");
  return absl::OkStatus();
}

}  // namespace mapkeep
