// The points of a scan, in any format. Input: a byte for the format, then the payload. The number of points is what a
// Draco payload says, or as many as fit into the other.

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string_view>

#include "core/scan_payload/scan_payload.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size < 1) return 0;
  const auto format = data[0] % 2 == 0 ? mapkeep::PayloadFormat::kDraco : mapkeep::PayloadFormat::kFloat32;
  const std::string_view payload(reinterpret_cast<const char*>(data) + 1, size - 1);
  uint32_t count = static_cast<uint32_t>(payload.size() / 16);
  if (format == mapkeep::PayloadFormat::kDraco) {
    constexpr size_t kCountAt = 11;
    if (payload.size() < kCountAt + sizeof count) return 0;
    std::memcpy(&count, payload.data() + kCountAt, sizeof count);
    count = std::min<uint32_t>(count, 50'000);  // for speed
  }
  const auto scan = mapkeep::DecodePayload(payload, format, count);
  if (scan.ok() && (scan->points.size() != count || scan->intensities.size() != count)) std::abort();
  return 0;
}
