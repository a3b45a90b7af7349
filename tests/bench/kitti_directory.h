#pragma once

#include <fstream>
#include <iostream>
#include <string>
#include <utility>
#include <vector>

#include "core/geometry/pose.h"
#include "core/geometry/scan.h"

namespace mapkeep {

/// A KITTI-like session directory (velodyne/NNNNNN.bin, poses.txt) for benchmarks, with only the checks that keep a
/// typing error from passing for a result. The product's reader is client/readers.
struct KittiDirectory {
  std::string path;
  std::vector<Pose> poses;

  explicit KittiDirectory(std::string directory) : path(std::move(directory)) {
    std::ifstream file(path + "/poses.txt");
    for (PoseRows rows; [&] {
           for (double& value : rows) file >> value;
           return static_cast<bool>(file);
         }();) {
      poses.push_back(*PoseFromRows(rows));
    }
    if (poses.empty()) {
      std::cerr << path << "/poses.txt: no poses\n";
      std::exit(2);
    }
  }

  /// The scans of the given frames, read anew each time.
  ScanSource Source(std::vector<size_t> frames) const {
    return {frames.size(), [path = path, frames](size_t index) { return Read(path, frames[index]); }};
  }

  static absl::StatusOr<Scan> Read(const std::string& path, size_t frame) {
    std::string name = std::to_string(frame);
    name.insert(0, 6 - name.size(), '0');
    std::ifstream file(path + "/velodyne/" + name + ".bin", std::ios::binary);
    Scan scan;
    for (float row[4]; file.read(reinterpret_cast<char*>(row), sizeof row);) {
      scan.points.emplace_back(row[0], row[1], row[2]);
      scan.intensities.push_back(row[3]);
    }
    if (scan.points.empty()) return absl::NotFoundError("no points in frame " + name);
    return scan;
  }
};

}  // namespace mapkeep
