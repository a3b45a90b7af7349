#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <string_view>

#include "storage/session_store.h"

namespace mapkeep {

// A staged scan as it is stored. Numbers are little-endian; floats are their IEEE 754 bits, so that a scan comes back
// as it was, bit for bit.
//
//   value    := 'S' version:u8 checksum:u32 flags:u8 count:u32 time:f64 pose:f64 x 12 content
//   version  := 1: packed | 2: plain by columns, as earlier programs wrote it | 3: plain
//   checksum: CRC-32C of the value without these four bytes; if plain of the content first, then of what is before it
//   flags    := bit 0: there are intensities
//   pose     := [R t] of T_odometry_sensor, row by row
//   content  := packed: columns | plain by columns: (x y z):f32 x 3 x count, then the intensities f32 x count if any
//             | plain: (x y z intensity if any):f32 x count, which is a float32 payload (core/scan_payload)
//   columns  := one zstd frame of x, y, z f32 x count, then the intensities f32 x count if there are any, each column
//   as
//               four planes of bytes, the lowest bytes of all points first

enum class ScanForm {
  kPacked,  ///< some 60 % of the plain size, for some 5 ms of a processor a scan of 120,000 points
  kPlain,   ///< as fast as memory is copied
};

/// Bytes of a value before its content, which it has at least.
inline constexpr size_t kScanContentAt = 115;
inline std::string_view ContentOf(std::string_view value) {
  return {value.data() + kScanContentAt, value.size() - kScanContentAt};
}

/// INVALID_ARGUMENT if the intensities do not match the points.
absl::StatusOr<std::string> EncodeScan(const StagedScan& scan, ScanForm form = ScanForm::kPacked);

/// Makes a plain value of one that has its content already, behind kScanContentAt bytes of anything: points with
/// intensities, 16 bytes each, where they came in. `content_crc32c` is theirs.
void SealPlainScan(std::string& value, double time, const Pose& pose, uint32_t content_crc32c);

/// Points in a value.
size_t PointsIn(std::string_view value);

/// The packed form of a value in plain form.
absl::StatusOr<std::string> PackScan(std::string_view plain);

/// Of any form. DATA_LOSS if anything about the value is wrong.
absl::StatusOr<StagedScan> DecodeScan(std::string_view value);

}  // namespace mapkeep
