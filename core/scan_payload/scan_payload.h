#pragma once

#include <absl/status/statusor.h>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "core/geometry/scan.h"

namespace mapkeep {

// The points of a scan as bytes, on their way from a robot. Numbers are little-endian.
//
//   float32 := (x:f32 y:f32 z:f32 intensity:f32) x count; metres, intensity in [0, 1]
//   draco   := a Draco 2.3 bitstream of a point cloud by the sequential encoder, which keeps the points' order, without
//              metadata, with two attributes in one group:
//                POSITION, 3 x float32, id 0, quantised as the robot likes (EncodePayload: steps of 1 cm or 1 mm)
//                GENERIC, 1 x uint8, id 1: intensity * 255, rounded

/// How a payload is written.
enum class PayloadFormat : uint8_t { kFloat32, kDraco };

/// What a robot chooses: as measured, or coordinates rounded to steps of 1 cm or 1 mm (off by half a step at most) and
/// intensities to 1/255.
enum class ScanEncoding : uint8_t { kRaw, kDraco1Cm, kDraco1Mm };

constexpr PayloadFormat FormatOf(ScanEncoding encoding) {
  return encoding == ScanEncoding::kRaw ? PayloadFormat::kFloat32 : PayloadFormat::kDraco;
}

/// "raw", "draco-1cm" or "draco-1mm"; nothing if it is none of them.
std::optional<ScanEncoding> ScanEncodingNamed(std::string_view name);

/// The scan's points as bytes; unknown intensities are 0. The same scan gives the same bytes. Draco: INVALID_ARGUMENT
/// naming the first point that is not finite or whose intensity is not in [0, 1], or if there is no point, or if they
/// are too far apart to be counted in steps.
absl::StatusOr<std::string> EncodePayload(const Scan& scan, ScanEncoding encoding);

/// The longest payload that `count` points may have.
size_t LargestPayload(uint32_t count, PayloadFormat format);

/// The points and intensities of a payload that holds `count` of them; values are as the bytes say, finite or not.
/// INVALID_ARGUMENT for anything else: whatever the bytes are, this takes no more memory than a small multiple of what
/// `count` points take.
absl::StatusOr<Scan> DecodePayload(std::string_view bytes, PayloadFormat format, uint32_t count);

}  // namespace mapkeep
