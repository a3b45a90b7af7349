// A stored plan of a tile. Input: a byte for how deep to begin, then 1: a byte for how many of the cells are walls, and
// the columns before they are compressed, other: the value. What decodes must come back the same when it is encoded.

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>

#include "server/pipeline/plan_codec.h"
#include "storage/byte_planes.h"
#include "storage/zstd.h"

namespace {

constexpr size_t kWallBytes = 10, kFloorBytes = 12;

std::string ValueOf(uint8_t depth, std::string_view bytes) {
  if (depth != 1 || bytes.empty()) return std::string(bytes);
  const size_t most_walls = static_cast<uint8_t>(bytes[0]);
  bytes.remove_prefix(1);
  const size_t walls = std::min(most_walls, bytes.size() / kWallBytes);
  const size_t floors = (bytes.size() - walls * kWallBytes) / kFloorBytes;
  mapkeep::Parts parts{.bytes = std::string(bytes.substr(0, walls * kWallBytes + floors * kFloorBytes)), .ends = {}};
  parts.Cut();
  std::string value = "P\x01";
  mapkeep::AppendNumber<4>(value, walls);
  mapkeep::AppendNumber<4>(value, floors);
  const auto frame = mapkeep::Compress(parts, 1);
  return frame.ok() ? value + *frame : value;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size < 1) return 0;
  const auto plan = mapkeep::DecodePlan(ValueOf(data[0] % 2, {reinterpret_cast<const char*>(data) + 1, size - 1}));
  if (!plan.ok()) return 0;
  const auto encoded = mapkeep::EncodePlan(*plan);
  if (!encoded.ok()) std::abort();
  const auto again = mapkeep::DecodePlan(*encoded);
  // By their bytes: a height that is not a number equals nothing.
  if (!again.ok() || *mapkeep::EncodePlan(*again) != *encoded) std::abort();
  return 0;
}
