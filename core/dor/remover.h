#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "core/dor/parameters.h"
#include "core/geometry/pose.h"
#include "core/geometry/progress.h"
#include "core/geometry/scan.h"
#include "core/voxels/evidence.h"

namespace mapkeep {

/// What dynamic object removal decided for one point.
enum class PointLabel : uint8_t {
  kStatic = 0,   ///< kept
  kGround = 1,   ///< kept, and part of the ground
  kDynamic = 2,  ///< removed: belongs to something that moved
};

/// Counts of the points that were labelled, for reports.
struct LabelCounts {
  uint64_t points = 0;
  uint64_t removed = 0;
  uint64_t restored = 0;  ///< given back by eq. 6

  void Add(const LabelCounts& other) {
    points += other.points;
    removed += other.removed;
    restored += other.restored;
  }
};

/// Counts of one removal, for reports.
struct RemovalReport {
  uint64_t voxels = 0;
  uint64_t dynamic_voxels = 0;
  uint64_t ground_voxels = 0;
};

/// The verdict on a session: statistics a voxel, from which any scan's points are labelled on demand, so that a session
/// of any length stays out of memory.
class Removal {
 public:
  struct State;
  explicit Removal(std::shared_ptr<const State> state) : state_(std::move(state)) {}

  /// One label a point of scan `index` of the session that was judged; `scan` is what the source gave for it. Depends
  /// on its arguments and the session alone; may be called from several threads at once. Adds to `counts`, if given.
  std::vector<PointLabel> Label(size_t index, const Scan& scan, LabelCounts* counts = nullptr) const;

  /// H and E of every voxel that was hit and of every watched one, before removal.
  const Evidence& evidence() const;

  const RemovalReport& report() const;

 private:
  std::shared_ptr<const State> state_;
};

/// Dynamic object removal on an aligned session (paper section 3.3, eq. 3-7). `poses[i]` takes scan i to the frame in
/// which voxels are counted: the map frame relative to the map's origin, z up within 5 degrees. `watched` (sorted, may
/// be empty) are further voxels whose exposures are to be counted: those of the map at the base epoch. Runs on the
/// calling oneTBB arena; the result does not depend on the number of threads. INVALID_ARGUMENT for counts that do not
/// match or parameters out of their range, OUT_OF_RANGE for a point beyond the 21-bit range (scan and point named),
/// CANCELLED when `progress` says stop.
absl::StatusOr<Removal> RemoveDynamicObjects(const ScanSource& scans, std::span<const Pose> poses,
                                             std::span<const VoxelKey> watched, const DorParameters& parameters,
                                             const Progress& progress = {});

}  // namespace mapkeep
