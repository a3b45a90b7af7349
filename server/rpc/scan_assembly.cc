#include "server/rpc/scan_assembly.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
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

/// Given the payload's own.
uint32_t Checksum(const v1::ScanHeader& header, uint32_t crc) {
  const auto add = [&crc](const double* values, size_t count) {
    crc = Crc32c({reinterpret_cast<const char*>(values), count * sizeof(double)}, crc);
  };
  const auto& rows = header.pose().rows();
  add(rows.data(), rows.size());
  const double time = header.time();
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

struct PointOnWire {
  Eigen::Vector3f position;
  float intensity;
};
static_assert(sizeof(PointOnWire) == kBytesPerPoint);

PointOnWire PointAt(std::string_view points, size_t index) {
  std::array<float, 4> values;  // the bytes may lie anywhere
  std::memcpy(values.data(), points.data() + index * kBytesPerPoint, kBytesPerPoint);
  return {{values[0], values[1], values[2]}, values[3]};
}

absl::Status CheckPoint(size_t index, const PointOnWire& point, const Pose& pose, double voxel_size) {
  const auto& [position, intensity] = point;
  if (!position.allFinite() || !std::isfinite(intensity)) {
    return absl::InvalidArgumentError(absl::StrFormat("point %d is not finite", index));
  }
  if (!(intensity >= 0 && intensity <= 1)) {
    return absl::InvalidArgumentError(
        absl::StrFormat("point %d has intensity %g, expected a value in [0, 1]", index, intensity));
  }
  const auto voxel = VoxelIndexOf(pose * position.cast<double>(), voxel_size);
  if (voxel.ok()) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("point ", index, ": ", voxel.status().message()));
}

// Whether a look at each number suffices: all finite, all points surely inside the map's range wherever they lie about
// the sensor, every intensity a share. False says only that each must be looked at closely.
bool AllSurelyFine(std::string_view points, const Pose& in_map, double voxel_size) {
  // Metres, with room for what rounding and a rotation that is one but for rounding may add.
  const double reach = 0.9 * kVoxelLimit * voxel_size - in_map.translation().cwiseAbs().maxCoeff();
  if (!(reach > 0)) return false;
  const auto side = static_cast<float>(std::min(reach / std::sqrt(3), 1e15));  // of the cube within that reach
  const std::array<float, 4> least = {-side, -side, -side, 0}, most = {side, side, side, 1};
  constexpr size_t kAtOnce = 4;  // points: what vectors of any processor hold
  const auto are_fine = [&](const char* at) {
    std::array<float, 4 * kAtOnce> values;  // the bytes may lie anywhere
    std::memcpy(values.data(), at, sizeof values);
    bool fine = true;
    for (size_t i = 0; i < values.size(); ++i) fine &= (values[i] >= least[i % 4]) & (values[i] <= most[i % 4]);
    return fine;  // false for NaN
  };
  constexpr size_t kStep = kAtOnce * kBytesPerPoint;
  if (points.size() < kStep) return false;
  bool fine = are_fine(points.data() + points.size() - kStep);
  for (size_t at = 0; at + kStep <= points.size(); at += kStep) fine &= are_fine(points.data() + at);
  return fine;
}

absl::Status CheckPoints(std::string_view points, const Pose& in_map, double voxel_size) {
  if (AllSurelyFine(points, in_map, voxel_size)) return absl::OkStatus();
  for (size_t i = 0; i < points.size() / kBytesPerPoint; ++i) {
    if (absl::Status status = CheckPoint(i, PointAt(points, i), in_map, voxel_size); !status.ok()) return status;
  }
  return absl::OkStatus();
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

absl::Status ScanAssembly::Append(std::span<const std::string_view> chunk) {
  if (!scan_) return absl::InvalidArgumentError("a chunk outside of a scan: a scan's header comes first");
  size_t size = 0;
  for (const std::string_view piece : chunk) size += piece.size();
  if (size > kLargestChunk) {
    return absl::InvalidArgumentError(
        absl::StrFormat("scan %d: a chunk of %d bytes, expected at most 1 MiB", scan_->header.index(), size));
  }
  if (bytes() + size > Wanted()) {
    return absl::InvalidArgumentError(absl::StrFormat("scan %d: more than the %d bytes of its %d points",
                                                      scan_->header.index(), Wanted(), scan_->header.point_count()));
  }
  // Not the whole of what a header only claims.
  if (bytes() == 0) scan_->value.reserve(kScanContentAt + std::min(Wanted(), kReserved));
  for (const std::string_view piece : chunk) scan_->value += piece;
  return absl::OkStatus();
}

RawScan ScanAssembly::Take() {
  RawScan raw = *std::move(scan_);
  scan_.reset();
  return raw;
}

std::string ScanAssembly::Description() const {
  return absl::StrFormat("scan %d has %d of %d bytes", scan_->header.index(), bytes(), Wanted());
}

size_t ScanAssembly::Wanted() const {
  const v1::ScanHeader& header = scan_->header;
  return header.payload_bytes() != 0 ? header.payload_bytes()
                                     : LargestPayload(header.point_count(), PayloadFormat::kFloat32);
}

size_t RawScan::DecodedBytes() const { return kBytesPerPoint * header.point_count(); }

absl::StatusOr<PlainScan> CheckScan(RawScan raw, uint32_t promised_crc32c, const MapRange& range) {
  const v1::ScanHeader& header = raw.header;
  const uint32_t scan = header.index();
  const uint32_t payload_crc32c = Crc32c(raw.payload());
  if (const uint32_t found = Checksum(header, payload_crc32c); found != header.crc32c()) {
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

  const size_t payload_bytes = raw.payload().size();
  PlainScan plain{std::move(raw.value), payload_bytes};
  const auto content = [&plain] { return ContentOf(plain.value); };
  if (FormatOf(header) == PayloadFormat::kFloat32) {
    SealPlainScan(plain.value, header.time(), *pose, payload_crc32c);
  } else {
    auto points = DecodePayload(content(), FormatOf(header), header.point_count());
    if (!points.ok()) return At(scan, points.status());
    points->time = header.time();
    auto value = EncodeScan({.scan = *std::move(points), .pose = *pose}, ScanForm::kPlain);
    if (!value.ok()) return At(scan, value.status());
    plain.value = *std::move(value);
  }
  LetOthersRun();
  Pose in_map = *pose;
  in_map.translation() -= range.origin;
  if (absl::Status status = CheckPoints(content(), in_map, range.voxel_size); !status.ok()) return At(scan, status);
  return plain;
}

}  // namespace mapkeep
