#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "client/exporters/map_exporter.h"
#include "client/exporters/spool_file.h"
#include "core/tiling/tile_point.h"

namespace mapkeep {

/// The block with only the sub-voxels that an export asks for: those inside the box, and of centroids the one of each
/// voxel that holds its mean. Voxels without any are left out.
Block Selected(const Block& block, double voxel_size, const ExportOptions& options);

/// Points of tiles, on disk until the newest day of the map is known, from which their ages count.
class SpooledPoints {
 public:
  struct Part {
    uint64_t offset = 0;
    size_t count = 0;
  };

  static absl::StatusOr<SpooledPoints> Create(const std::filesystem::path& beside);

  /// Notes when the block was seen last.
  void See(const Block& block);
  /// Days since 2000-01-01 UTC.
  uint16_t newest_day() const { return newest_day_; }

  absl::StatusOr<Part> Add(std::span<const TilePoint> points);
  absl::StatusOr<std::vector<TilePoint>> Read(const Part& part);

 private:
  explicit SpooledPoints(SpoolFile spool) : spool_(std::move(spool)) {}

  SpoolFile spool_;
  uint16_t newest_day_ = 0;
};

}  // namespace mapkeep
