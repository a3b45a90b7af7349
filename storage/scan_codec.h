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
//   version  := 1: packed | 2: plain
//   checksum: CRC-32C of the whole value without these four bytes
//   flags    := bit 0: there are intensities
//   pose     := [R t] of T_odometry_sensor, row by row
//   content  := columns if packed, else (x y z):f32 x 3 x count, then the intensities f32 x count if there are any
//   columns  := one zstd frame of x, y, z f32 x count, then the intensities f32 x count if there are any, each column
//   as
//               four planes of bytes, the lowest bytes of all points first

enum class ScanForm {
  kPacked,  ///< some 60 % of the plain size, for some 5 ms of a processor a scan of 120,000 points
  kPlain,   ///< as fast as memory is copied
};

/// INVALID_ARGUMENT if the intensities do not match the points.
absl::StatusOr<std::string> EncodeScan(const StagedScan& scan, ScanForm form = ScanForm::kPacked);

/// Of either form. DATA_LOSS if anything about the value is wrong.
absl::StatusOr<StagedScan> DecodeScan(std::string_view value);

}  // namespace mapkeep
