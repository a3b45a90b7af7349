#pragma once

#include <absl/status/status.h>

namespace mapkeep {

/// Every parameter of dynamic object removal, with the symbol of the paper's section 3.3.
struct DorParameters {
  double voxel_size = 0.2;            ///< metres
  double eta = 1e-3;                  ///< eta of eq. 4, scans
  double stability_threshold = 0.35;  ///< R below it: a dynamic candidate
};

/// INVALID_ARGUMENT naming the field, its value and its range.
absl::Status CheckParameters(const DorParameters& parameters);

}  // namespace mapkeep
