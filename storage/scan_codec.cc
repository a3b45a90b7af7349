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
constexpr char kPackedVersion = 1, kPlainVersion = 2;
constexpr size_t kChecksumAt = 2, kFlagsAt = 6, kCountAt = 7, kTimeAt = 11, kPoseAt = 19;
constexpr size_t kContentAt = kPoseAt + 12 * sizeof(double);
constexpr uint32_t kMaxPoints = 1U << 27;  ///< what a damaged count may not pass
constexpr int kZstdLevel = 1;

uint32_t ChecksumOf(std::string_view value) {
  return Crc32c(value.substr(kFlagsAt), Crc32c(value.substr(0, kChecksumAt)));
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
              "points in memory are points as they are stored plain");

size_t PointBytes(size_t count) { return count * sizeof(Eigen::Vector3f); }
size_t IntensityBytes(size_t count) { return count * sizeof(float); }

void AppendPlain(const Scan& scan, std::string& value) {
  value.append(reinterpret_cast<const char*>(scan.points.data()), PointBytes(scan.points.size()));
  value.append(reinterpret_cast<const char*>(scan.intensities.data()), IntensityBytes(scan.intensities.size()));
}

/// Into a scan that has the size of the bytes.
void ReadPlain(std::string_view bytes, Scan& scan) {
  const size_t points = PointBytes(scan.points.size()), intensities = IntensityBytes(scan.intensities.size());
  if (points > 0) std::memcpy(scan.points.data()->data(), bytes.data(), points);
  if (intensities > 0) std::memcpy(scan.intensities.data(), bytes.data() + points, intensities);
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
  absl::StatusOr<std::string> columns;
  if (!plain) {
    columns = Compress(Columns(scan), kZstdLevel);
    if (!columns.ok()) return columns.status();
  }
  std::string value;
  value.reserve(kContentAt +
                (plain ? PointBytes(scan.points.size()) + IntensityBytes(scan.intensities.size()) : columns->size()));
  value.push_back(kMagic);
  value.push_back(plain ? kPlainVersion : kPackedVersion);
  AppendNumber<4>(value, 0);
  AppendNumber<1>(value, scan.intensities.empty() ? 0 : 1);
  AppendNumber<4>(value, scan.points.size());
  AppendNumber<8>(value, std::bit_cast<uint64_t>(scan.time));
  for (const double entry : RowsOf(staged.pose)) AppendNumber<8>(value, std::bit_cast<uint64_t>(entry));
  if (plain) {
    AppendPlain(scan, value);
  } else {
    value.append(*columns);
  }
  std::string checksum;
  AppendNumber<4>(checksum, ChecksumOf(value));
  std::memcpy(value.data() + kChecksumAt, checksum.data(), checksum.size());
  return value;
}

absl::StatusOr<StagedScan> DecodeScan(std::string_view value) {
  const auto damaged = [](std::string_view why) { return absl::DataLossError(Text("staged scan: ", why)); };
  if (value.size() < kContentAt) return damaged("the value is cut short");
  if (NumberAt<4>(value.data() + kChecksumAt) != ChecksumOf(value)) return damaged("the checksum does not match");
  if (value[0] != kMagic) return damaged("this is not a scan");
  const bool plain = value[1] == kPlainVersion;
  if (!plain && value[1] != kPackedVersion) {
    return damaged(Text("format version ", int{value[1]}, ", known are 1 and 2"));
  }
  const uint64_t flags = NumberAt<1>(value.data() + kFlagsAt);
  const size_t count = NumberAt<4>(value.data() + kCountAt);
  if (flags > 1 || count > kMaxPoints) return damaged("its header makes no sense");
  const std::string_view content = value.substr(kContentAt);
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
  if (plain) {
    ReadPlain(content, staged.scan);
    return staged;
  }
  if (absl::Status status = ReadColumns(content, staged.scan); !status.ok()) {
    return damaged(FromAbsl(status.message()));
  }
  return staged;
}

}  // namespace mapkeep
