#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "client/exporters/output_file.h"

namespace mapkeep {

enum class PointFileFormat : uint8_t { kPcd, kPly };

/// By the extension, .pcd or .ply. INVALID_ARGUMENT for any other.
absl::StatusOr<PointFileFormat> PointFileFormatOf(const std::filesystem::path& path);

/// How x, y and z are written. The intensity is always float32, [0, 1].
enum class CoordinateType : uint8_t {
  kFloat32,  ///< what every reader takes; 1 mm within 10 km of the origin
  kFloat64,  ///< for coordinates far from zero, such as UTM
};

/// Writes points x y z intensity to an uncompressed binary PCD 0.7 or little-endian PLY 1.0 file in constant memory.
/// The number of points is known only at the end, so the header is written twice, in the same length: a padded comment
/// makes up for the digits. The file appears when Finish has succeeded (see OutputFile).
class PointFileWriter {
 public:
  /// `comments` go into the header, a line each.
  static absl::StatusOr<PointFileWriter> Create(const std::filesystem::path& path, PointFileFormat format,
                                                CoordinateType coordinates, std::vector<std::string> comments = {});
  /// The same; the extension decides the format.
  static absl::StatusOr<PointFileWriter> Create(const std::filesystem::path& path, CoordinateType coordinates,
                                                std::vector<std::string> comments = {});

  /// What goes wrong shows in Finish.
  void Add(const Eigen::Vector3d& point, float intensity);

  uint64_t count() const { return count_; }

  absl::Status Finish();

 private:
  PointFileWriter(OutputFile file, PointFileFormat format, CoordinateType coordinates,
                  std::vector<std::string> comments);

  std::string Header(uint64_t count) const;

  OutputFile file_;
  PointFileFormat format_;
  CoordinateType coordinates_;
  std::vector<std::string> comments_;
  uint64_t count_ = 0;
};

}  // namespace mapkeep
