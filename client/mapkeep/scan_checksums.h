#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/geometry/pose.h"
#include "core/geometry/progress.h"
#include "core/geometry/scan.h"
#include "core/scan_payload/scan_payload.h"

namespace mapkeep {

/// CRC-32C over the payload's bytes, the 12 pose values and the time (proto: ScanHeader.crc32c).
uint32_t ScanChecksum(std::string_view payload, const Pose& pose, double time);

/// The checksum of every scan as it is sent in that encoding: the content of a session. Reads all scans, several at a
/// time (oneTBB), so that a bad one is found before anything is sent: the error is that of the first scan that has one.
/// CANCELLED when `progress` says stop.
absl::StatusOr<std::vector<uint32_t>> ScanChecksums(const ScanSource& scans, std::span<const Pose> poses,
                                                    const Progress& progress = {},
                                                    ScanEncoding encoding = ScanEncoding::kRaw);

}  // namespace mapkeep
