#include "client/readers/pcd_file.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/string_view.h>
#include <pcl/PCLPointCloud2.h>
#include <pcl/console/print.h>
#include <pcl/io/pcd_io.h>

#include <array>
#include <cstring>
#include <exception>
#include <string>

#include "client/readers/pcd_header.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

absl::Status AtFile(const fs::path& file, absl::string_view what) {
  return absl::InvalidArgumentError(absl::StrCat(file.string(), ": ", what));
}

/// PCL reports bad files by return codes, exceptions and prints: all become a status here.
absl::StatusOr<pcl::PCLPointCloud2> ReadCloud(const fs::path& file) {
  static const bool silenced = [] {
    pcl::console::setVerbosityLevel(pcl::console::L_ALWAYS);
    return true;
  }();
  (void)silenced;
  pcl::PCLPointCloud2 cloud;
  try {
    if (pcl::PCDReader().read(file.string(), cloud) >= 0) return cloud;
  } catch (const std::exception& error) {
    return AtFile(file, absl::StrCat("its points cannot be read: ", error.what()));
  }
  return AtFile(file, "its points cannot be read: truncated or damaged");
}

template <typename Number>
float Load(const uint8_t* bytes) {
  Number number;
  std::memcpy(&number, bytes, sizeof(number));
  return static_cast<float>(number);
}

/// One number of every point as float32, whatever its type in the file.
struct Column {
  uint32_t offset = 0;
  float (*load)(const uint8_t* bytes) = nullptr;

  float Of(const uint8_t* point) const { return load(point + offset); }
};

Column ColumnOf(const PcdHeader::Field& field) {
  switch (field.type) {
    case 'F':
      return {field.offset, field.size == 4 ? Load<float> : Load<double>};
    case 'U':
      if (field.size == 1) return {field.offset, Load<uint8_t>};
      if (field.size == 2) return {field.offset, Load<uint16_t>};
      return {field.offset, field.size == 4 ? Load<uint32_t> : Load<uint64_t>};
    default:
      if (field.size == 1) return {field.offset, Load<int8_t>};
      if (field.size == 2) return {field.offset, Load<int16_t>};
      return {field.offset, field.size == 4 ? Load<int32_t> : Load<int64_t>};
  }
}

}  // namespace

absl::StatusOr<Scan> ReadPcdPoints(const fs::path& file) {
  absl::StatusOr<PcdHeader> header = ReadPcdHeader(file);
  if (!header.ok()) return header.status();
  std::array<Column, 3> axes;
  for (size_t axis = 0; axis < axes.size(); ++axis) {
    const PcdHeader::Field* field = FindField(*header, std::array{"x", "y", "z"}[axis]);
    if (field == nullptr) return AtFile(file, "has no fields x, y and z");
    axes[axis] = ColumnOf(*field);
  }
  const PcdHeader::Field* intensity = FindField(*header, "intensity");
  if (header->points == 0) return Scan();  // PCL takes an empty cloud for a damaged one

  absl::StatusOr<pcl::PCLPointCloud2> cloud = ReadCloud(file);
  if (!cloud.ok()) return cloud.status();
  if (cloud->point_step != header->point_bytes || cloud->data.size() < header->points * header->point_bytes) {
    return AtFile(file, "its points cannot be read: PCL understands the header otherwise");
  }
  Scan scan;
  scan.points.reserve(header->points);
  for (size_t i = 0; i < header->points; ++i) {
    const uint8_t* point = cloud->data.data() + i * header->point_bytes;
    scan.points.emplace_back(axes[0].Of(point), axes[1].Of(point), axes[2].Of(point));
    if (intensity != nullptr) scan.intensities.push_back(ColumnOf(*intensity).Of(point));
  }
  return scan;
}

}  // namespace mapkeep
