#pragma once

#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <string>
#include <vector>

namespace mapkeep {

/// A directory of one test's own, removed after it.
class TemporaryDirectory {
 public:
  TemporaryDirectory();
  ~TemporaryDirectory();
  TemporaryDirectory(const TemporaryDirectory&) = delete;
  TemporaryDirectory& operator=(const TemporaryDirectory&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

using PointRow = std::array<float, 4>;  ///< x y z intensity, as in a KITTI file

inline const std::string kIdentityRow = "1 0 0 0 0 1 0 0 0 0 1 0\n";

void WriteText(const std::filesystem::path& file, const std::string& text);
void WriteBin(const std::filesystem::path& file, const std::vector<PointRow>& points);

/// A good session in the kitti layout: `count` scans of three points each, the sensor moving 1 m a scan along x.
void WriteKittiSession(const std::filesystem::path& directory, size_t count);

}  // namespace mapkeep
