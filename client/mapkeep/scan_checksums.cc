#include "client/mapkeep/scan_checksums.h"

#include <absl/status/status.h>
#include <absl/strings/str_format.h>
#include <tbb/parallel_for.h>

#include <bit>
#include <mutex>
#include <string_view>

#include "core/checksum/crc32c.h"

namespace mapkeep {

static_assert(std::endian::native == std::endian::little, "the wire carries little-endian numbers");

uint32_t ScanChecksum(std::string_view payload, const Pose& pose, double time) {
  const PoseRows rows = RowsOf(pose);
  uint32_t checksum = Crc32c(payload);
  checksum = Crc32c({reinterpret_cast<const char*>(rows.data()), sizeof(rows)}, checksum);
  return Crc32c({reinterpret_cast<const char*>(&time), sizeof(time)}, checksum);
}

absl::StatusOr<std::vector<uint32_t>> ScanChecksums(const ScanSource& scans, std::span<const Pose> poses,
                                                    const Progress& progress, ScanEncoding encoding) {
  if (poses.size() != scans.count) {
    return absl::InvalidArgumentError(absl::StrFormat("%d poses for %d scans", poses.size(), scans.count));
  }
  std::vector<uint32_t> checksums(scans.count);
  std::mutex mutex;  // guards the four below
  bool stopped = false;
  size_t done = 0;
  size_t first_bad = scans.count;
  absl::Status error;
  tbb::parallel_for(size_t{0}, scans.count, [&](size_t i) {
    {
      // Scans after a bad one need no reading; those before it do, for the first error is the one to report.
      const std::lock_guard lock(mutex);
      if (stopped || i > first_bad) return;
    }
    const absl::StatusOr<Scan> scan = scans.read(i);
    absl::Status status = scan.status();
    if (status.ok()) {
      const absl::StatusOr<std::string> payload = EncodePayload(*scan, encoding);
      if (payload.ok()) checksums[i] = ScanChecksum(*payload, poses[i], scan->time);
      if (!payload.ok()) {
        status = absl::Status(payload.status().code(), absl::StrFormat("scan %d: %s", i, payload.status().message()));
      }
    }
    const std::lock_guard lock(mutex);
    if (!status.ok() && i < first_bad) {
      first_bad = i;
      error = status;
    }
    ++done;
    if (progress && !stopped && !progress(static_cast<double>(done) / static_cast<double>(scans.count))) {
      stopped = true;
    }
  });
  if (!error.ok()) return error;
  if (stopped) return absl::CancelledError("stopped");
  return checksums;
}

}  // namespace mapkeep
