// The chunk in a message of an upload, found without a parser: if it is found, Protobuf finds the same. Input: a byte
// for the length of the pieces that the message comes in, then the message.

#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>
#include <vector>

#include "mapkeep/v1/session_service.pb.h"
#include "server/rpc/chunk_message.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size < 1) return 0;
  const size_t each = 1 + data[0];
  const std::string_view message(reinterpret_cast<const char*>(data) + 1, size - 1);
  std::vector<std::string_view> pieces;
  for (size_t at = 0; at < message.size(); at += each) pieces.push_back(message.substr(at, each));
  const auto chunk = mapkeep::ChunkIn(pieces);
  if (!chunk) return 0;
  std::string found;
  for (const std::string_view piece : *chunk) found += piece;
  mapkeep::v1::UploadScansRequest parsed;
  if (!parsed.ParseFromArray(message.data(), static_cast<int>(message.size())) || !parsed.has_chunk() ||
      parsed.chunk() != found) {
    std::abort();
  }
  return 0;
}
