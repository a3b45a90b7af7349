#include "client/exporters/las.h"

#include <absl/strings/str_format.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <string_view>
#include <utility>

#include "client/exporters/coordinate_system.h"
#include "client/exporters/output_file.h"

namespace mapkeep {
namespace {

static_assert(std::endian::native == std::endian::little, "the format is written little-endian");

constexpr double kScale = 0.001;  // metres
constexpr size_t kHeaderBytes = 375, kPointBytes = 31;
constexpr uint16_t kAdjustedGpsTime = 1, kHasWkt = 16;  // bits of the global encoding
constexpr uint8_t kUnclassified = 1, kGround = 2;       // ASPRS classes
/// Seconds from 1980-01-06 (GPS) to 2000-01-01, with the 13 leap seconds until then, and those from then to now.
constexpr double kGpsAt2000 = 630720013, kLeapSince2000 = 5, kAdjustment = 1e9;
constexpr double kEta = 1e-3;  // eta of eq. 4, scans

/// A record of known layout, built field by field.
class Fields {
 public:
  template <typename Number>
  Fields& Put(Number number) {
    bytes_.append(reinterpret_cast<const char*>(&number), sizeof(number));
    return *this;
  }
  Fields& Text(std::string_view text, size_t width) {
    bytes_.append(text.substr(0, width));
    bytes_.append(width - std::min(width, text.size()), '\0');
    return *this;
  }
  Fields& Zeros(size_t count) {
    bytes_.append(count, '\0');
    return *this;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

std::string VariableRecord(std::string_view user, uint16_t id, std::string_view description, const std::string& data) {
  return Fields()
             .Put(uint16_t{0})
             .Text(user, 16)
             .Put(id)
             .Put(static_cast<uint16_t>(data.size()))
             .Text(description, 32)
             .bytes() +
         data;
}

/// What describes the byte after each point: R = value / 255.
std::string ExtraByteRecord() {
  constexpr uint8_t kUnsignedByte = 1, kHasScale = 8;
  Fields item;
  item.Zeros(2).Put(kUnsignedByte).Put(kHasScale).Text("stability", 32).Zeros(4);
  item.Zeros(24).Zeros(24).Zeros(24);  // no data, min, max
  item.Put(1.0 / 255).Zeros(16);       // scale
  item.Zeros(24).Text("R = H / (H + E)", 32);
  return VariableRecord("LASF_Spec", 4, "Extra Bytes", item.bytes());
}

class Las final : public MapExporter {
 public:
  Las(OutputFile file, std::string records, uint32_t record_count, const ExportedMap& map, const ExportOptions& options)
      : file_(std::move(file)),
        records_(std::move(records)),
        record_count_(record_count),
        map_(map),
        options_(options),
        offset_(map.OriginOrZero().array().floor()) {
    file_.stream() << Header() << records_;
  }

  absl::Status Add(const Block& block) override {
    absl::Status status;
    const Eigen::Vector3d shift = map_.OriginOrZero() - offset_;
    ForEachPoint(block, map_.voxel_size, options_.detail, options_.box,
                 [&](const Eigen::Vector3d& point, const Voxel& voxel) { status.Update(Write(point + shift, voxel)); });
    return status;
  }

  absl::Status Finish() override {
    file_.stream().seekp(0) << Header();
    return file_.Finish();
  }

 private:
  absl::Status Write(const Eigen::Vector3d& point, const Voxel& voxel) {
    const Eigen::Array3d steps = (point.array() / kScale).round();
    if (!(steps.abs() <= std::numeric_limits<int32_t>::max()).all()) {
      return absl::OutOfRangeError(
          absl::StrFormat("the point %.3f %.3f %.3f lies farther from the origin than LAS reaches in millimetres",
                          point.x(), point.y(), point.z()));
    }
    std::array<char, kPointBytes> row{};
    const std::array<int32_t, 3> xyz = {static_cast<int32_t>(steps.x()), static_cast<int32_t>(steps.y()),
                                        static_cast<int32_t>(steps.z())};
    for (int axis = 0; axis < 3; ++axis) {
      lowest_[axis] = std::min(lowest_[axis], xyz[axis]);
      highest_[axis] = std::max(highest_[axis], xyz[axis]);
    }
    std::memcpy(&row[0], xyz.data(), 12);
    const auto intensity = static_cast<uint16_t>(voxel.intensity * 257);
    std::memcpy(&row[12], &intensity, 2);
    row[14] = 0x11;  // the only return of one
    row[16] = static_cast<char>(voxel.ground ? kGround : kUnclassified);
    const double gps_time = kGpsAt2000 + kLeapSince2000 + 60.0 * voxel.last_seen - kAdjustment;
    std::memcpy(&row[22], &gps_time, 8);
    row[30] = static_cast<char>(std::lround(255 * Stability(voxel.hits, voxel.exposures, kCountScale * kEta)));
    file_.stream().write(row.data(), row.size());
    ++count_;
    return absl::OkStatus();
  }

  std::string Header() const {
    Fields header;
    header.Text("LASF", 4).Put(uint16_t{0}).Put(static_cast<uint16_t>(kAdjustedGpsTime | kHasWkt)).Zeros(16);
    header.Put(uint8_t{1}).Put(uint8_t{4}).Text("MAPKEEP", 32).Text("mapkeep", 32);
    header.Zeros(4).Put(static_cast<uint16_t>(kHeaderBytes)).Put(static_cast<uint32_t>(kHeaderBytes + records_.size()));
    header.Put(record_count_).Put(uint8_t{6}).Put(static_cast<uint16_t>(kPointBytes));
    header.Zeros(24);  // the counts of older versions
    for (int axis = 0; axis < 3; ++axis) header.Put(kScale);
    for (int axis = 0; axis < 3; ++axis) header.Put(offset_[axis]);
    for (int axis = 0; axis < 3; ++axis) {
      header.Put(count_ == 0 ? offset_[axis] : offset_[axis] + kScale * highest_[axis]);
      header.Put(count_ == 0 ? offset_[axis] : offset_[axis] + kScale * lowest_[axis]);
    }
    header.Zeros(20);  // no waveforms, no extended records
    header.Put(count_).Put(count_).Zeros(size_t{14} * 8);
    return header.bytes();
  }

  OutputFile file_;
  const std::string records_;
  const uint32_t record_count_;
  const ExportedMap map_;
  const ExportOptions options_;
  const Eigen::Vector3d offset_;
  std::array<int32_t, 3> lowest_ = {std::numeric_limits<int32_t>::max(), std::numeric_limits<int32_t>::max(),
                                    std::numeric_limits<int32_t>::max()};
  std::array<int32_t, 3> highest_ = {std::numeric_limits<int32_t>::min(), std::numeric_limits<int32_t>::min(),
                                     std::numeric_limits<int32_t>::min()};
};

}  // namespace

absl::StatusOr<std::unique_ptr<MapExporter>> OpenLas(const std::filesystem::path& path, const ExportedMap& map,
                                                     const ExportOptions& options) {
  std::string records = ExtraByteRecord();
  uint32_t record_count = 1;
  if (!map.crs.empty()) {
    const absl::StatusOr<std::string> text = WellKnownTextOf(map.crs);
    if (!text.ok()) return text.status();
    records += VariableRecord("LASF_Projection", 2112, "OGC coordinate system WKT", *text + '\0');
    ++record_count;
  }
  absl::StatusOr<OutputFile> file = OutputFile::Create(path);
  if (!file.ok()) return file.status();
  return std::make_unique<Las>(*std::move(file), std::move(records), record_count, map, options);
}

}  // namespace mapkeep
