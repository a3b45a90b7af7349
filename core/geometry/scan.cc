#include "core/geometry/scan.h"

#include <absl/strings/str_format.h>

#include <memory>
#include <utility>

namespace mapkeep {

ScanSource SourceOf(std::vector<Scan> scans) {
  auto held = std::make_shared<const std::vector<Scan>>(std::move(scans));
  return {held->size(), [held](size_t index) -> absl::StatusOr<Scan> { return (*held)[index]; }};
}

absl::Status CheckScan(const Scan& scan) {
  if (scan.points.empty()) return absl::InvalidArgumentError("the scan has no points");
  if (!scan.intensities.empty() && scan.intensities.size() != scan.points.size()) {
    return absl::InvalidArgumentError(
        absl::StrFormat("%d intensities for %d points", scan.intensities.size(), scan.points.size()));
  }
  for (size_t i = 0; i < scan.points.size(); ++i) {
    if (!scan.points[i].allFinite()) return absl::InvalidArgumentError(absl::StrFormat("point %d is not finite", i));
  }
  return absl::OkStatus();
}

}  // namespace mapkeep
