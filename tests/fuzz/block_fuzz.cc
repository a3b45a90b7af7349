// A stored block. Input: a byte for how deep to begin, then 1: what follows the checksum, 2: the columns before they
// are compressed, other: the value. What decodes must come back the same when it is encoded.

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string>

#include "core/checksum/crc32c.h"
#include "storage/block_codec.h"
#include "storage/byte_planes.h"
#include "storage/zstd.h"

namespace {

constexpr size_t kColumnBytes = 29;  // a voxel

std::string WithChecksum(std::string_view body) {
  std::string value = "B\x01";
  std::string checksum;
  mapkeep::AppendNumber<4>(checksum, mapkeep::Crc32c(body, mapkeep::Crc32c(value)));
  return value + checksum + std::string(body);
}

std::string ValueOf(uint8_t depth, std::string_view bytes) {
  if (depth == 1) return WithChecksum(bytes);
  if (depth != 2) return std::string(bytes);
  mapkeep::Parts parts{.bytes = std::string(bytes.substr(0, bytes.size() / kColumnBytes * kColumnBytes)), .ends = {}};
  parts.Cut();
  std::string body;
  mapkeep::AppendNumber<8>(body, 0);
  mapkeep::AppendNumber<4>(body, bytes.size() / kColumnBytes);
  const auto columns = mapkeep::Compress(parts, 1);
  return WithChecksum(columns.ok() ? body + *columns : body);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size < 1) return 0;
  const std::string value = ValueOf(data[0] % 3, {reinterpret_cast<const char*>(data) + 1, size - 1});
  const auto block = mapkeep::DecodeBlock(value, mapkeep::BlockKey{0});
  if (!block.ok()) return 0;
  const auto encoded = mapkeep::EncodeBlock(*block);
  if (!encoded.ok()) std::abort();
  const auto again = mapkeep::DecodeBlock(*encoded, mapkeep::BlockKey{0});
  if (!again.ok() || !(*again == *block)) std::abort();
  return 0;
}
