#include "core/registration/window_cloud.h"

#include "core/registration/point_tree.h"
#include "core/registration/surface_normals.h"

namespace mapkeep {
namespace {

constexpr double kThinning = 2;                                                                       // source voxels
constexpr size_t kFinePoints = 10000, kCoarsePoints = 5000, kSampleSize = 10000, kScanPoints = 3000;  // at most

// Every so many-th, so that at most `most` are left.
size_t StepFor(size_t count, size_t most) { return (count + most - 1) / most; }

SurfaceCloud Spread(std::span<const Eigen::Vector3d> points, std::span<const Eigen::Vector3d> normals, size_t most) {
  SurfaceCloud cloud;
  for (size_t i = 0; i < points.size(); i += StepFor(points.size(), most)) {
    cloud.points.push_back(points[i]);
    cloud.normals.push_back(normals[i]);
  }
  return cloud;
}

}  // namespace

WindowCloud::WindowCloud(std::span<const Eigen::Vector3d> query, double source_voxel)
    : numbers_(kThinning * source_voxel) {
  if (query.empty()) return;
  const std::vector<Eigen::Vector3d> points = ThinPoints(query, numbers_);
  const PointTree tree(query);
  normals_.reserve(points.size());
  for (const SurfaceNormal& surface : SurfaceNormalsAt(points, query, tree)) normals_.push_back(surface.normal);
  fine_ = Spread(points, normals_, kFinePoints);
  coarse_ = Spread(points, normals_, kCoarsePoints);
  for (size_t i = 0; i < query.size(); i += StepFor(query.size(), kSampleSize)) sample_.push_back(query[i]);
}

SurfaceCloud WindowCloud::SurfacesOf(std::span<const Eigen::Vector3d> scan) const {
  const std::vector<Eigen::Vector3d> points = ThinPoints(scan, numbers_.edge());
  SurfaceCloud cloud;
  for (size_t i = 0; i < points.size(); i += StepFor(points.size(), kScanPoints)) {
    const auto number = numbers_.Find(points[i]);
    cloud.points.push_back(points[i]);
    cloud.normals.push_back(number ? normals_[*number] : Eigen::Vector3d::Zero());
  }
  return cloud;
}

}  // namespace mapkeep
