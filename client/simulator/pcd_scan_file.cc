#include "client/simulator/pcd_scan_file.h"

#include <absl/strings/str_cat.h>
#include <pcl/PCLPointCloud2.h>
#include <pcl/io/pcd_io.h>

#include <array>
#include <cstring>
#include <exception>

namespace mapkeep {
namespace {

constexpr uint32_t kPointBytes = 4 * sizeof(float);

pcl::PCLPointCloud2 CloudOf(const Scan& scan) {
  pcl::PCLPointCloud2 cloud;
  cloud.height = 1;
  cloud.width = static_cast<uint32_t>(scan.points.size());
  cloud.point_step = kPointBytes;
  cloud.row_step = cloud.width * kPointBytes;
  cloud.is_dense = 1;
  constexpr std::array<const char*, 4> kNames = {"x", "y", "z", "intensity"};
  for (uint32_t i = 0; i < kNames.size(); ++i) {
    pcl::PCLPointField field;
    field.name = kNames[i];
    field.offset = i * sizeof(float);
    field.datatype = pcl::PCLPointField::FLOAT32;
    field.count = 1;
    cloud.fields.push_back(field);
  }
  cloud.data.resize(size_t{cloud.width} * kPointBytes);
  for (size_t i = 0; i < scan.points.size(); ++i) {
    const Eigen::Vector3f& p = scan.points[i];
    const std::array<float, 4> values = {p.x(), p.y(), p.z(), scan.intensities[i]};
    std::memcpy(cloud.data.data() + i * kPointBytes, values.data(), kPointBytes);
  }
  return cloud;
}

}  // namespace

absl::Status WritePcdScan(const std::filesystem::path& file, const Scan& scan, const Pose& viewpoint,
                          PcdEncoding encoding) {
  const pcl::PCLPointCloud2 cloud = CloudOf(scan);
  Eigen::Vector4f origin = Eigen::Vector4f::Zero();
  origin.head<3>() = viewpoint.translation().cast<float>();
  const Eigen::Quaternionf orientation(Eigen::Quaterniond(viewpoint.linear()).cast<float>());
  int result = -1;
  std::string what = "the disk may be full";
  try {
    pcl::PCDWriter writer;
    switch (encoding) {
      case PcdEncoding::kBinary:
        result = writer.writeBinary(file.string(), cloud, origin, orientation);
        break;
      case PcdEncoding::kAscii:
        result = writer.writeASCII(file.string(), cloud, origin, orientation, 9);
        break;
      case PcdEncoding::kCompressed:
        result = writer.writeBinaryCompressed(file.string(), cloud, origin, orientation);
        break;
    }
  } catch (const std::exception& error) {  // PCL reports some failures by exceptions
    what = error.what();
  }
  if (result >= 0) return absl::OkStatus();
  return absl::UnknownError(absl::StrCat(file.string(), ": cannot be written: ", what));
}

}  // namespace mapkeep
