#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <Eigen/Geometry>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "client/exporters/map_points.h"
#include "core/voxels/block.h"

namespace mapkeep {

/// What a file needs to know of the map that it shows. Nothing about when or whence: equal maps give equal files.
struct ExportedMap {
  double voxel_size = 0;                  ///< metres
  std::optional<Eigen::Vector3d> origin;  ///< of the blocks' coordinates, metres; nothing: the map has none
  std::string crs;                        ///< "EPSG:N" or empty

  Eigen::Vector3d OriginOrZero() const { return origin.value_or(Eigen::Vector3d::Zero()); }
};

struct ExportOptions {
  PointDetail detail = PointDetail::kSubVoxels;
  std::optional<Eigen::AlignedBox3d> box;  ///< only the points inside, metres relative to the origin
  bool absolute = false;                   ///< adds the origin; coordinates become float64
  bool compressed = false;                 ///< PCD: binary_compressed
};

/// Writes a map block by block in memory that does not grow with it. Blocks come in order of tile, none twice. What is
/// not finished leaves nothing behind.
class MapExporter {
 public:
  virtual ~MapExporter() = default;
  virtual absl::Status Add(const Block& block) = 0;
  /// The file or directory appears, whole.
  virtual absl::Status Finish() = 0;
  /// Points written; of an archive, voxels.
  uint64_t count() const { return count_; }

 protected:
  uint64_t count_ = 0;
};

enum class ExportFormat : uint8_t {
  kPcd,
  kPly,
  kLas,
  kAutoware,
  kOctoMap,
  kGlb,
  kTiles3d,
  kArchive,
};

/// What the command line shows of a format.
struct ExportFormatInfo {
  ExportFormat format = ExportFormat::kPcd;
  std::string_view name;
  std::string_view suffix;      ///< by which it is told; empty: only by its name
  std::string_view what;        ///< in a few words
  bool whole_voxels = false;    ///< holds voxels, not points: everything that the map has of them
  bool can_be_absolute = true;  ///< takes ExportOptions::absolute
};

const std::vector<ExportFormatInfo>& ExportFormats();
const ExportFormatInfo& InfoOf(ExportFormat format);

/// By `name` if it is not empty, else by the suffix of the path. INVALID_ARGUMENT listing what there is.
absl::StatusOr<ExportFormat> ExportFormatOf(const std::filesystem::path& path, std::string_view name);

/// INVALID_ARGUMENT for options that the format does not have; errors naming the file if it cannot be made.
absl::StatusOr<std::unique_ptr<MapExporter>> OpenExporter(ExportFormat format, const std::filesystem::path& path,
                                                          const ExportedMap& map, const ExportOptions& options);

}  // namespace mapkeep
