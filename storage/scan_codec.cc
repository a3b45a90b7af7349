#include "storage/scan_codec.h"

#include <bit>
#include <cstring>

#include "core/checksum/crc32c.h"
#include "storage/byte_planes.h"
#include "storage/text.h"
#include "storage/zstd.h"

namespace mapkeep {
namespace {

constexpr char kMagic = 'S';
constexpr char kPackedVersion = 1, kPlainColumnsVersion = 2, kPlainVersion = 3;
constexpr size_t kVersionAt = 1, kChecksumAt = 2, kFlagsAt = 6, kCountAt = 7, kTimeAt = 11, kPoseAt = 19;
static_assert(kScanContentAt == kPoseAt + 12 * sizeof(double));
constexpr uint32_t kMaxPoints = 1U << 27;  ///< what a damaged count may not pass
constexpr int kZstdLevel = 1;

uint32_t ChecksumOfHeader(std::string_view value, uint32_t before) {
  return Crc32c(value.substr(kFlagsAt, kScanContentAt - kFlagsAt), Crc32c(value.substr(0, kChecksumAt), before));
}

/// The content's own checksum is often known already, so in a plain value it comes first.
uint32_t ChecksumOf(std::string_view value) {
  const std::string_view content = ContentOf(value);
  return value[kVersionAt] == kPlainVersion ? ChecksumOfHeader(value, Crc32c(content))
                                            : Crc32c(content, ChecksumOfHeader(value, 0));
}

void WriteChecksum(std::string& value, uint32_t checksum) {
  std::string bytes;
  AppendNumber<4>(bytes, checksum);
  std::memcpy(value.data() + kChecksumAt, bytes.data(), bytes.size());
}

/// What is before the content, but for the checksum.
std::string Header(char version, bool intensities, size_t count, double time, const Pose& pose) {
  std::string header;
  header.reserve(kScanContentAt);
  header.push_back(kMagic);
  header.push_back(version);
  AppendNumber<4>(header, 0);
  AppendNumber<1>(header, intensities ? 1 : 0);
  AppendNumber<4>(header, count);
  AppendNumber<8>(header, std::bit_cast<uint64_t>(time));
  for (const double entry : RowsOf(pose)) AppendNumber<8>(header, std::bit_cast<uint64_t>(entry));
  return header;
}

/// Each plane of bytes is a part: the low bytes of a float are noise, its high ones are few.
template <typename Get>
void AppendFloats(Parts& parts, size_t count, const Get& get) {
  const size_t begin = parts.bytes.size();
  AppendPlanes<4>(parts.bytes, count, [&](size_t i) { return std::bit_cast<uint32_t>(get(i)); });
  for (size_t plane = 1; plane <= 4 && count > 0; ++plane) parts.ends.push_back(begin + plane * count);
}

Parts Columns(const Scan& scan) {
  Parts parts;
  parts.bytes.reserve(sizeof(float) * (3 * scan.points.size() + scan.intensities.size()));
  for (int axis = 0; axis < 3; ++axis) {
    AppendFloats(parts, scan.points.size(), [&](size_t i) { return scan.points[i][axis]; });
  }
  AppendFloats(parts, scan.intensities.size(), [&](size_t i) { return scan.intensities[i]; });
  return parts;
}

static_assert(sizeof(Eigen::Vector3f) == 3 * sizeof(float) && std::endian::native == std::endian::little,
              "points in memory are points as they are stored plain by columns");

size_t PointBytes(size_t count) { return count * sizeof(Eigen::Vector3f); }
size_t IntensityBytes(size_t count) { return count * sizeof(float); }

void AppendPlain(const Scan& scan, std::string& value) {
  for (size_t i = 0; i < scan.points.size(); ++i) {
    value.append(reinterpret_cast<const char*>(scan.points[i].data()), PointBytes(1));
    if (!scan.intensities.empty()) {
      value.append(reinterpret_cast<const char*>(&scan.intensities[i]), IntensityBytes(1));
    }
  }
}

/// Into a scan that has the size of the bytes.
void ReadPlain(const char* at, Scan& scan) {
  for (size_t i = 0; i < scan.points.size(); ++i) {
    std::memcpy(scan.points[i].data(), at, PointBytes(1));
    at += PointBytes(1);
    if (scan.intensities.empty()) continue;
    std::memcpy(&scan.intensities[i], at, IntensityBytes(1));
    at += IntensityBytes(1);
  }
}

/// Likewise.
void ReadPlainColumns(const char* at, Scan& scan) {
  const size_t points = PointBytes(scan.points.size()), intensities = IntensityBytes(scan.intensities.size());
  if (points > 0) std::memcpy(scan.points.data()->data(), at, points);
  if (intensities > 0) std::memcpy(scan.intensities.data(), at + points, intensities);
}

absl::Status ReadColumns(std::string_view frame, Scan& scan) {
  const size_t count = scan.points.size(), intensities = scan.intensities.size();
  const absl::StatusOr<std::string> columns = Decompress(frame, PointBytes(count) + IntensityBytes(intensities));
  if (!columns.ok()) return columns.status();
  const char* at = columns->data();
  for (int axis = 0; axis < 3; ++axis) {
    at = ReadPlanes<4>(at, count, [&](size_t i, uint64_t bits) {
      scan.points[i][axis] = std::bit_cast<float>(static_cast<uint32_t>(bits));
    });
  }
  ReadPlanes<4>(at, intensities, [&](size_t i, uint64_t bits) {
    scan.intensities[i] = std::bit_cast<float>(static_cast<uint32_t>(bits));
  });
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::string> EncodeScan(const StagedScan& staged, ScanForm form) {
  const Scan& scan = staged.scan;
  if (!scan.intensities.empty() && scan.intensities.size() != scan.points.size()) {
    return absl::InvalidArgumentError(
        Text(scan.intensities.size(), " intensities for ", scan.points.size(), " points"));
  }
  if (scan.points.size() > kMaxPoints) {
    return absl::InvalidArgumentError(Text("a scan of ", scan.points.size(), " points"));
  }
  const bool plain = form == ScanForm::kPlain;
  std::string value = Header(plain ? kPlainVersion : kPackedVersion, !scan.intensities.empty(), scan.points.size(),
                             scan.time, staged.pose);
  if (plain) {
    value.reserve(kScanContentAt + PointBytes(scan.points.size()) + IntensityBytes(scan.intensities.size()));
    AppendPlain(scan, value);
  } else {
    const absl::StatusOr<std::string> columns = Compress(Columns(scan), kZstdLevel);
    if (!columns.ok()) return columns.status();
    value.append(*columns);
  }
  WriteChecksum(value, ChecksumOf(value));
  return value;
}

void SealPlainScan(std::string& value, double time, const Pose& pose, uint32_t content_crc32c) {
  const size_t count = (value.size() - kScanContentAt) / (PointBytes(1) + IntensityBytes(1));
  const std::string header = Header(kPlainVersion, true, count, time, pose);
  std::memcpy(value.data(), header.data(), header.size());
  WriteChecksum(value, ChecksumOfHeader(value, content_crc32c));
}

size_t PointsIn(std::string_view value) { return NumberAt<4>(value.data() + kCountAt); }

absl::StatusOr<std::string> PackScan(std::string_view plain) {
  const absl::StatusOr<StagedScan> scan = DecodeScan(plain);
  if (!scan.ok()) return scan.status();
  return EncodeScan(*scan, ScanForm::kPacked);
}

absl::StatusOr<StagedScan> DecodeScan(std::string_view value) {
  const auto damaged = [](std::string_view why) { return absl::DataLossError(Text("staged scan: ", why)); };
  if (value.size() < kScanContentAt) return damaged("the value is cut short");
  if (NumberAt<4>(value.data() + kChecksumAt) != ChecksumOf(value)) return damaged("the checksum does not match");
  if (value[0] != kMagic) return damaged("this is not a scan");
  const char version = value[kVersionAt];
  if (version < kPackedVersion || version > kPlainVersion) {
    return damaged(Text("format version ", int{version}, ", known are 1 to 3"));
  }
  const bool plain = version != kPackedVersion;
  const uint64_t flags = NumberAt<1>(value.data() + kFlagsAt);
  const size_t count = NumberAt<4>(value.data() + kCountAt);
  if (flags > 1 || count > kMaxPoints) return damaged("its header makes no sense");
  const std::string_view content = ContentOf(value);
  // Before there is memory for what a damaged count asks for.
  if (plain && content.size() != PointBytes(count) + (flags == 1 ? IntensityBytes(count) : 0)) {
    return damaged(Text(content.size(), " bytes do not hold ", count, " points"));
  }

  StagedScan staged;
  staged.scan.time = std::bit_cast<double>(NumberAt<8>(value.data() + kTimeAt));
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) {
      const size_t at = kPoseAt + sizeof(double) * (4 * row + column);
      staged.pose.matrix()(row, column) = std::bit_cast<double>(NumberAt<8>(value.data() + at));
    }
  }
  staged.scan.points.resize(count);
  staged.scan.intensities.resize(flags == 1 ? count : 0);
  if (version == kPlainVersion) ReadPlain(content.data(), staged.scan);
  if (version == kPlainColumnsVersion) ReadPlainColumns(content.data(), staged.scan);
  if (plain) return staged;
  if (absl::Status status = ReadColumns(content, staged.scan); !status.ok()) {
    return damaged(FromAbsl(status.message()));
  }
  return staged;
}

}  // namespace mapkeep
