#include "storage/scan_codec.h"

#include <bit>
#include <cstring>
#include <functional>

#include "core/checksum/crc32c.h"
#include "storage/byte_planes.h"
#include "storage/text.h"
#include "storage/zstd.h"

namespace mapkeep {
namespace {

constexpr char kMagic = 'S';
constexpr char kVersion = 1;
constexpr size_t kChecksumAt = 2, kFlagsAt = 6, kCountAt = 7, kTimeAt = 11, kPoseAt = 19;
constexpr size_t kColumnsAt = kPoseAt + 12 * sizeof(double);
constexpr uint32_t kMaxPoints = 1U << 27;  ///< what a damaged count may not pass
constexpr int kZstdLevel = 1;

uint32_t ChecksumOf(std::string_view value) {
  return Crc32c(value.substr(kFlagsAt), Crc32c(value.substr(0, kChecksumAt)));
}

/// Each plane of bytes is a part: the low bytes of a float are noise, its high ones are few.
void AppendFloats(Parts& parts, size_t count, const std::function<float(size_t)>& get) {
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

}  // namespace

absl::StatusOr<std::string> EncodeScan(const StagedScan& staged) {
  const Scan& scan = staged.scan;
  if (!scan.intensities.empty() && scan.intensities.size() != scan.points.size()) {
    return absl::InvalidArgumentError(
        Text(scan.intensities.size(), " intensities for ", scan.points.size(), " points"));
  }
  if (scan.points.size() > kMaxPoints) {
    return absl::InvalidArgumentError(Text("a scan of ", scan.points.size(), " points"));
  }
  const absl::StatusOr<std::string> columns = Compress(Columns(scan), kZstdLevel);
  if (!columns.ok()) return columns.status();
  std::string value;
  value.reserve(kColumnsAt + columns->size());
  value.push_back(kMagic);
  value.push_back(kVersion);
  AppendNumber<4>(value, 0);
  AppendNumber<1>(value, scan.intensities.empty() ? 0 : 1);
  AppendNumber<4>(value, scan.points.size());
  AppendNumber<8>(value, std::bit_cast<uint64_t>(scan.time));
  for (const double entry : RowsOf(staged.pose)) AppendNumber<8>(value, std::bit_cast<uint64_t>(entry));
  value.append(*columns);
  std::string checksum;
  AppendNumber<4>(checksum, ChecksumOf(value));
  std::memcpy(value.data() + kChecksumAt, checksum.data(), checksum.size());
  return value;
}

absl::StatusOr<StagedScan> DecodeScan(std::string_view value) {
  const auto damaged = [](std::string_view why) { return absl::DataLossError(Text("staged scan: ", why)); };
  if (value.size() <= kColumnsAt) return damaged("the value is cut short");
  if (NumberAt<4>(value.data() + kChecksumAt) != ChecksumOf(value)) return damaged("the checksum does not match");
  if (value[0] != kMagic) return damaged("this is not a scan");
  if (value[1] != kVersion) return damaged(Text("format version ", int{value[1]}, ", known is 1"));
  const uint64_t flags = NumberAt<1>(value.data() + kFlagsAt);
  const size_t count = NumberAt<4>(value.data() + kCountAt);
  if (flags > 1 || count > kMaxPoints) return damaged("its header makes no sense");
  const size_t intensities = flags == 1 ? count : 0;
  const absl::StatusOr<std::string> columns =
      Decompress(value.substr(kColumnsAt), sizeof(float) * (3 * count + intensities));
  if (!columns.ok()) return damaged(FromAbsl(columns.status().message()));

  StagedScan staged;
  staged.scan.time = std::bit_cast<double>(NumberAt<8>(value.data() + kTimeAt));
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) {
      const size_t at = kPoseAt + sizeof(double) * (4 * row + column);
      staged.pose.matrix()(row, column) = std::bit_cast<double>(NumberAt<8>(value.data() + at));
    }
  }
  staged.scan.points.resize(count);
  staged.scan.intensities.resize(intensities);
  const char* at = columns->data();
  for (int axis = 0; axis < 3; ++axis) {
    at = ReadPlanes<4>(at, count, [&](size_t i, uint64_t bits) {
      staged.scan.points[i][axis] = std::bit_cast<float>(static_cast<uint32_t>(bits));
    });
  }
  ReadPlanes<4>(at, intensities, [&](size_t i, uint64_t bits) {
    staged.scan.intensities[i] = std::bit_cast<float>(static_cast<uint32_t>(bits));
  });
  return staged;
}

}  // namespace mapkeep
