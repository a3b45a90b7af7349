#include "core/scan_payload/scan_payload.h"

#include <absl/status/status.h>
#include <absl/strings/str_format.h>

#include <bit>
#include <cstring>

#include "core/scan_payload/draco_payload.h"

namespace mapkeep {
namespace {

static_assert(std::endian::native == std::endian::little, "payloads are little-endian");

constexpr size_t kPointBytes = 4 * sizeof(float);

std::string EncodeFloats(const Scan& scan) {
  std::string bytes(scan.points.size() * kPointBytes, '\0');
  for (size_t i = 0; i < scan.points.size(); ++i) {
    const float intensity = scan.intensities.empty() ? 0.F : scan.intensities[i];
    char* point = bytes.data() + i * kPointBytes;
    std::memcpy(point, scan.points[i].data(), 3 * sizeof(float));
    std::memcpy(point + 3 * sizeof(float), &intensity, sizeof(float));
  }
  return bytes;
}

absl::StatusOr<Scan> DecodeFloats(std::string_view bytes, uint32_t count) {
  if (bytes.size() != count * kPointBytes) {
    return absl::InvalidArgumentError(
        absl::StrFormat("%d bytes for %d points, expected %d", bytes.size(), count, count * kPointBytes));
  }
  Scan scan;
  scan.points.resize(count);
  scan.intensities.resize(count);
  const char* at = bytes.data();
  for (uint32_t i = 0; i < count; ++i, at += kPointBytes) {
    std::memcpy(scan.points[i].data(), at, 3 * sizeof(float));
    std::memcpy(&scan.intensities[i], at + 3 * sizeof(float), sizeof(float));
  }
  return scan;
}

}  // namespace

std::optional<ScanEncoding> ScanEncodingNamed(std::string_view name) {
  if (name == "raw") return ScanEncoding::kRaw;
  if (name == "draco-1cm") return ScanEncoding::kDraco1Cm;
  if (name == "draco-1mm") return ScanEncoding::kDraco1Mm;
  return std::nullopt;
}

absl::StatusOr<std::string> EncodePayload(const Scan& scan, ScanEncoding encoding) {
  switch (encoding) {
    case ScanEncoding::kRaw:
      return EncodeFloats(scan);
    case ScanEncoding::kDraco1Cm:
      return EncodeDraco(scan, 0.01);
    case ScanEncoding::kDraco1Mm:
      return EncodeDraco(scan, 0.001);
  }
  return absl::InvalidArgumentError("an unknown encoding of scans");
}

size_t LargestPayload(uint32_t count, PayloadFormat format) {
  // Noise that does not compress takes Draco some bytes more than it is long.
  constexpr size_t kOverhead = 4096;
  return kPointBytes * count + (format == PayloadFormat::kDraco ? kOverhead : 0);
}

absl::StatusOr<Scan> DecodePayload(std::string_view bytes, PayloadFormat format, uint32_t count) {
  return format == PayloadFormat::kDraco ? DecodeDraco(bytes, count) : DecodeFloats(bytes, count);
}

}  // namespace mapkeep
