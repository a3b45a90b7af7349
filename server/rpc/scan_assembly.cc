#include "server/rpc/scan_assembly.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <string_view>
#include <utility>

#include "core/checksum/crc32c.h"
#include "core/scan_payload/scan_payload.h"
#include "core/voxels/voxel_index.h"
#include "server/rpc/convert.h"
#include "storage/pause.h"

namespace mapkeep {
namespace {

static_assert(std::endian::native == std::endian::little, "points and checksums are little-endian on the wire");

constexpr size_t kBytesPerPoint = 4 * sizeof(float);  // once they are decoded
constexpr uint32_t kMostPoints = 4'000'000;
constexpr size_t kLargestChunk = 1 << 20;
constexpr size_t kReserved = 4 << 20;

absl::Status At(uint32_t scan, const absl::Status& status) {
  return {status.code(), absl::StrCat("scan ", scan, ": ", status.message())};
}

uint32_t Checksum(const RawScan& raw) {
  uint32_t crc = Crc32c(raw.bytes);
  const auto add = [&crc](const double* values, size_t count) {
    crc = Crc32c({reinterpret_cast<const char*>(values), count * sizeof(double)}, crc);
  };
  const auto& rows = raw.header.pose().rows();
  add(rows.data(), rows.size());
  const double time = raw.header.time();
  add(&time, 1);
  return crc;
}

PayloadFormat FormatOf(const v1::ScanHeader& header) {
  return header.format() == v1::POINT_FORMAT_DRACO ? PayloadFormat::kDraco : PayloadFormat::kFloat32;
}

absl::Status CheckFormat(const v1::ScanHeader& header) {
  if (!v1::PointFormat_IsValid(header.format())) {
    return absl::InvalidArgumentError(
        absl::StrFormat("scan %d: point format %d is unknown here", header.index(), header.format()));
  }
  const size_t most = LargestPayload(header.point_count(), FormatOf(header));
  const bool given = header.payload_bytes() != 0;
  if (FormatOf(header) == PayloadFormat::kDraco ? given && header.payload_bytes() <= most
                                                : !given || header.payload_bytes() == most) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrFormat("scan %d: payload_bytes %d for %d points, expected %s%d",
                                                    header.index(), header.payload_bytes(), header.point_count(),
                                                    header.format() == v1::POINT_FORMAT_DRACO ? "1 to " : "", most));
}

absl::Status CheckPoint(size_t index, const Eigen::Vector3f& point, float intensity, const Pose& pose,
                        double voxel_size) {
  if (!point.allFinite() || !std::isfinite(intensity)) {
    return absl::InvalidArgumentError(absl::StrFormat("point %d is not finite", index));
  }
  if (!(intensity >= 0 && intensity <= 1)) {
    return absl::InvalidArgumentError(
        absl::StrFormat("point %d has intensity %g, expected a value in [0, 1]", index, intensity));
  }
  const auto voxel = VoxelIndexOf(pose * point.cast<double>(), voxel_size);
  if (voxel.ok()) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("point ", index, ": ", voxel.status().message()));
}

// Whether a look at each point's distance suffices: all finite, all surely inside the map's range wherever they lie
// about the sensor, every intensity a share. False says only that each must be looked at closely.
bool AllSurelyFine(const Scan& scan, const Pose& in_map, double voxel_size) {
  // Metres, with room for what rounding and a rotation that is one but for rounding may add.
  const double reach = 0.9 * kVoxelLimit * voxel_size - in_map.translation().cwiseAbs().maxCoeff();
  if (!(reach > 0)) return false;
  const auto reach_squared = static_cast<float>(std::min(reach * reach, 1e30));
  bool fine = true;
  for (const Eigen::Vector3f& point : scan.points) fine &= point.squaredNorm() <= reach_squared;  // false for NaN
  for (const float intensity : scan.intensities) fine &= intensity >= 0 && intensity <= 1;
  return fine;
}

}  // namespace

absl::Status ScanAssembly::Begin(v1::ScanHeader header) {
  if (scan_) return absl::InvalidArgumentError(absl::StrCat("a scan begins while ", Description()));
  if (header.point_count() == 0 || header.point_count() > kMostPoints) {
    return absl::InvalidArgumentError(absl::StrFormat("scan %d: point_count %d, expected 1 to %d", header.index(),
                                                      header.point_count(), kMostPoints));
  }
  if (absl::Status status = CheckFormat(header); !status.ok()) return status;
  scan_ = RawScan{.header = std::move(header)};
  return absl::OkStatus();
}

absl::Status ScanAssembly::Append(std::string chunk) {
  if (!scan_) return absl::InvalidArgumentError("a chunk outside of a scan: a scan's header comes first");
  if (chunk.size() > kLargestChunk) {
    return absl::InvalidArgumentError(
        absl::StrFormat("scan %d: a chunk of %d bytes, expected at most 1 MiB", scan_->header.index(), chunk.size()));
  }
  if (scan_->bytes.size() + chunk.size() > Wanted()) {
    return absl::InvalidArgumentError(absl::StrFormat("scan %d: more than the %d bytes of its %d points",
                                                      scan_->header.index(), Wanted(), scan_->header.point_count()));
  }
  if (chunk.size() == Wanted()) {
    scan_->bytes = std::move(chunk);
    return absl::OkStatus();
  }
  // Not the whole of what a header only claims.
  if (scan_->bytes.empty()) scan_->bytes.reserve(std::min(Wanted(), kReserved));
  scan_->bytes += chunk;
  return absl::OkStatus();
}

RawScan ScanAssembly::Take() {
  RawScan raw = *std::move(scan_);
  scan_.reset();
  return raw;
}

std::string ScanAssembly::Description() const {
  return absl::StrFormat("scan %d has %d of %d bytes", scan_->header.index(), scan_->bytes.size(), Wanted());
}

size_t ScanAssembly::Wanted() const {
  const v1::ScanHeader& header = scan_->header;
  return header.payload_bytes() != 0 ? header.payload_bytes()
                                     : LargestPayload(header.point_count(), PayloadFormat::kFloat32);
}

size_t RawScan::DecodedBytes() const { return kBytesPerPoint * header.point_count(); }

absl::StatusOr<StagedScan> DecodeScan(const RawScan& raw, uint32_t promised_crc32c, const MapRange& range) {
  const v1::ScanHeader& header = raw.header;
  const uint32_t scan = header.index();
  if (const uint32_t found = Checksum(raw); found != header.crc32c()) {
    return At(scan, absl::DataLossError(
                        absl::StrFormat("its content has crc32c %08x, its header says %08x", found, header.crc32c())));
  }
  if (header.crc32c() != promised_crc32c) {
    return At(scan, absl::InvalidArgumentError(absl::StrFormat("crc32c %08x, but BeginSession promised %08x",
                                                               header.crc32c(), promised_crc32c)));
  }
  if (!std::isfinite(header.time()) || header.time() < 0) {
    return At(scan, absl::InvalidArgumentError(absl::StrFormat("time %g, expected seconds since 1970", header.time())));
  }
  const auto pose = FromProto(header.pose());
  if (!pose.ok()) return At(scan, pose.status());

  LetOthersRun();
  auto points = DecodePayload(raw.bytes, FormatOf(header), header.point_count());
  if (!points.ok()) return At(scan, points.status());
  StagedScan staged{.scan = *std::move(points), .pose = *pose, .payload_bytes = raw.bytes.size()};
  staged.scan.time = header.time();
  LetOthersRun();
  Pose in_map = *pose;
  in_map.translation() -= range.origin;
  if (AllSurelyFine(staged.scan, in_map, range.voxel_size)) return staged;
  for (size_t i = 0; i < header.point_count(); ++i) {
    const absl::Status status =
        CheckPoint(i, staged.scan.points[i], staged.scan.intensities[i], in_map, range.voxel_size);
    if (!status.ok()) return At(scan, status);
  }
  return staged;
}

}  // namespace mapkeep
