#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "mapkeep/v1/session_service.pb.h"
#include "storage/scan_codec.h"
#include "storage/session_store.h"

namespace mapkeep {

/// A scan as the wire carries it.
struct RawScan {
  v1::ScanHeader header;
  /// The payload, behind room for what a stored scan has before its points: raw points are stored where they came in.
  std::string value = std::string(kScanContentAt, '\0');

  std::string_view payload() const { return ContentOf(value); }
  /// Memory that its points take when they are decoded, however few bytes they come in.
  size_t DecodedBytes() const;
};

/// Puts scans together from headers and chunks. Its memory grows with the bytes that came, not with those claimed.
class ScanAssembly {
 public:
  /// Begins a scan. INVALID_ARGUMENT if the last one is not complete, if it has no or too many points, or a payload
  /// that cannot be.
  absl::Status Begin(v1::ScanHeader header);
  /// A chunk, in the pieces that it came in. INVALID_ARGUMENT without a scan, or beyond its payload or 1 MiB.
  absl::Status Append(std::span<const std::string_view> chunk);

  bool under_way() const { return scan_.has_value(); }
  bool complete() const { return scan_ && bytes() == Wanted(); }
  size_t bytes() const { return scan_ ? scan_->payload().size() : 0; }
  /// The complete scan; another may begin.
  RawScan Take();
  /// "scan 3 has 100 of 1600 bytes", for what ends too early.
  std::string Description() const;

 private:
  size_t Wanted() const;

  std::optional<RawScan> scan_;
};

/// What a scan's points must fit into.
struct MapRange {
  double voxel_size = 0;                             ///< metres
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  ///< of the map, metres
};

/// The scan behind the bytes, checked, as it is stored: DATA_LOSS if they do not match the header's checksum;
/// INVALID_ARGUMENT if that is not the one promised, for bytes that do not decode, a bad pose, time or value (not
/// finite, intensity not in [0, 1]), and for a point that, moved by the pose, lies beyond the 21-bit range. Every error
/// names the scan, and the point if it is one.
absl::StatusOr<PlainScan> CheckScan(RawScan raw, uint32_t promised_crc32c, const MapRange& range);

}  // namespace mapkeep
