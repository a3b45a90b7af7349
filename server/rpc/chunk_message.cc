#include "server/rpc/chunk_message.h"

#include <cstddef>
#include <cstdint>

#include "mapkeep/v1/session_service.pb.h"

namespace mapkeep {
namespace {

constexpr uint8_t kLengthDelimited = 2;
constexpr uint8_t kTag = v1::UploadScansRequest::kChunkFieldNumber << 3 | kLengthDelimited;
constexpr int kLengthBytes = 4;  // of a varint; a chunk may have 2^20 bytes

}  // namespace

std::optional<std::vector<std::string_view>> ChunkIn(std::span<const std::string_view> message) {
  std::vector<std::string_view> pieces;
  pieces.reserve(message.size());
  bool tagged = false, measured = false;
  size_t length = 0, found = 0;
  int digits = 0;
  for (std::string_view rest : message) {
    for (; !rest.empty() && !measured; rest.remove_prefix(1)) {
      const auto byte = static_cast<uint8_t>(rest.front());
      if (!tagged) {
        if (byte != kTag) return std::nullopt;
        tagged = true;
        continue;
      }
      if (digits == kLengthBytes) return std::nullopt;
      length |= static_cast<size_t>(byte & 0x7F) << (7 * digits++);
      measured = byte < 0x80;
    }
    if (rest.empty()) continue;
    pieces.push_back(rest);
    found += rest.size();
  }
  if (!measured || found != length) return std::nullopt;
  return pieces;
}

}  // namespace mapkeep
