#include "client/readers/pcd_file.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/string_view.h>
#include <pcl/PCLPointCloud2.h>
#include <pcl/console/print.h>
#include <pcl/io/pcd_io.h>

#include <array>
#include <cstring>
#include <exception>
#include <string>
#include <string_view>
#include <vector>

#include "client/readers/session_directory.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

absl::Status AtFile(const fs::path& file, absl::string_view what) {
  return absl::InvalidArgumentError(absl::StrCat(file.string(), ": ", what));
}

struct Header {
  pcl::PCLPointCloud2 cloud;  ///< fields and size, no data
  Pose viewpoint = Pose::Identity();
};

/// PCL reports bad files by return codes, exceptions and prints: all become a status here.
template <typename Call>
absl::Status Guarded(const fs::path& file, Call call) {
  static const bool silenced = [] {
    pcl::console::setVerbosityLevel(pcl::console::L_ALWAYS);
    return true;
  }();
  (void)silenced;
  try {
    if (call() >= 0) return absl::OkStatus();
  } catch (const std::exception& error) {
    return AtFile(file, absl::StrCat("not a readable PCD file: ", error.what()));
  }
  return AtFile(file, "not a readable PCD file, or truncated");
}

absl::StatusOr<Header> ReadHeader(const fs::path& file) {
  std::error_code error;
  const uintmax_t bytes = fs::file_size(file, error);
  if (error) return absl::NotFoundError(absl::StrCat(file.string(), ": ", error.message()));
  Header header;
  Eigen::Vector4f origin = Eigen::Vector4f::Zero();
  Eigen::Quaternionf orientation = Eigen::Quaternionf::Identity();
  int version = 0, data_type = 0;
  unsigned int data_begin = 0;
  absl::Status read = Guarded(file, [&] {
    return pcl::PCDReader().readHeader(file.string(), header.cloud, origin, orientation, version, data_type,
                                       data_begin);
  });
  if (!read.ok()) return read;
  const uint64_t count = uint64_t{header.cloud.width} * header.cloud.height;
  if (count > kMostPoints) {
    return AtFile(file, absl::StrFormat("%d points, more than the %d a scan may hold", count, kMostPoints));
  }
  constexpr int kUncompressedBinary = 1;
  if (data_type == kUncompressedBinary && bytes < data_begin + count * header.cloud.point_step) {
    return AtFile(file, absl::StrFormat("truncated: %d bytes, but its header announces %d points of %d bytes", bytes,
                                        count, header.cloud.point_step));
  }
  if (!orientation.coeffs().allFinite() || !origin.allFinite() || std::abs(orientation.norm() - 1) > 1e-3) {
    return AtFile(file, "VIEWPOINT is not a finite translation and a unit quaternion");
  }
  header.viewpoint.linear() = orientation.cast<double>().normalized().toRotationMatrix();
  header.viewpoint.translation() = origin.head<3>().cast<double>();
  return header;
}

template <typename Number>
float Load(const uint8_t* bytes) {
  Number number;
  std::memcpy(&number, bytes, sizeof(number));
  return static_cast<float>(number);
}

using Loader = float (*)(const uint8_t*);

/// How to read one number of a field as float32, whatever its type in the file.
Loader LoaderOf(const pcl::PCLPointField& field) {
  switch (field.datatype) {
    case pcl::PCLPointField::INT8:
      return Load<int8_t>;
    case pcl::PCLPointField::UINT8:
      return Load<uint8_t>;
    case pcl::PCLPointField::INT16:
      return Load<int16_t>;
    case pcl::PCLPointField::UINT16:
      return Load<uint16_t>;
    case pcl::PCLPointField::INT32:
      return Load<int32_t>;
    case pcl::PCLPointField::UINT32:
      return Load<uint32_t>;
    case pcl::PCLPointField::FLOAT32:
      return Load<float>;
    case pcl::PCLPointField::FLOAT64:
      return Load<double>;
    default:
      return nullptr;
  }
}

struct Column {
  uint32_t offset = 0;
  Loader load = nullptr;  ///< null: there is no such field
};

Column ColumnNamed(const pcl::PCLPointCloud2& cloud, std::string_view name) {
  for (const pcl::PCLPointField& field : cloud.fields) {
    if (field.name == name) return {field.offset, LoaderOf(field)};
  }
  return {};
}

}  // namespace

absl::StatusOr<Pose> ReadPcdViewpoint(const fs::path& file) {
  absl::StatusOr<Header> header = ReadHeader(file);
  if (!header.ok()) return header.status();
  return header->viewpoint;
}

absl::StatusOr<Scan> ReadPcdPoints(const fs::path& file) {
  // The header is judged first: the reader allocates what it announces.
  absl::StatusOr<Header> header = ReadHeader(file);
  if (!header.ok()) return header.status();
  pcl::PCLPointCloud2 cloud;
  absl::Status read = Guarded(file, [&] { return pcl::PCDReader().read(file.string(), cloud); });
  if (!read.ok()) return read;

  const std::array<Column, 3> axes = {ColumnNamed(cloud, "x"), ColumnNamed(cloud, "y"), ColumnNamed(cloud, "z")};
  for (const Column& axis : axes) {
    if (axis.load == nullptr) return AtFile(file, "has no fields x, y and z");
  }
  const Column intensity = ColumnNamed(cloud, "intensity");
  const size_t count = size_t{cloud.width} * cloud.height;
  if (cloud.data.size() < count * cloud.point_step) return AtFile(file, "truncated");
  Scan scan;
  scan.points.reserve(count);
  for (size_t i = 0; i < count; ++i) {
    const uint8_t* point = cloud.data.data() + i * cloud.point_step;
    scan.points.emplace_back(axes[0].load(point + axes[0].offset), axes[1].load(point + axes[1].offset),
                             axes[2].load(point + axes[2].offset));
    if (intensity.load != nullptr) scan.intensities.push_back(intensity.load(point + intensity.offset));
  }
  return scan;
}

}  // namespace mapkeep
