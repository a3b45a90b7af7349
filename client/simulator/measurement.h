#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "client/simulator/ray_caster.h"
#include "client/simulator/sensor.h"
#include "core/geometry/scan.h"

namespace mapkeep {

/// Labels as SemanticKITTI and the tool that scores us know them.
inline constexpr uint32_t kStaticLabel = 9;
inline constexpr uint32_t kMovingLabel = 251;
/// Neither: what moved, but not far enough to say so (see Simulate). Not scored.
inline constexpr uint32_t kUnsureLabel = 0;
/// The label of a point is its low half; the high half is the id of its object, 0 for ids that do not fit.
constexpr uint32_t ClassOfLabel(uint32_t label) { return label & 0xffff; }
constexpr uint32_t ObjectOfLabel(uint32_t label) { return label >> 16; }

/// A scan and the truth about each of its points.
struct LabelledScan {
  Scan scan;
  std::vector<uint32_t> labels;  ///< one a point
};

/// What a sensor reports of the hits of its rays, `directions[i]` in its own frame, channel fastest:
/// - a pulse comes back with a chance that falls with range^2, reflectivity and incidence (rough surfaces: root of the
///   cosine), calibrated by `reach`; glass swallows four of five; a share `drop_out` is lost anyway;
/// - the range is noisy, more so where a slanted surface stretches the beam's spot;
/// - at an edge (the neighbouring firing's range is up to 2.5 m off) a beam that is cut gives a range in between: a
/// mixed
///   pixel, labelled as what its ray hit;
/// - intensity is reflectivity and incidence, in steps of 1/255.
/// `labels[k]` is given to the points of instance k. Random draws depend on `seed` and the index of the ray alone.
LabelledScan Measure(const SensorModel& sensor, std::span<const Eigen::Vector3f> directions,
                     std::span<const RayHit> hits, std::span<const uint32_t> labels, uint64_t seed);

}  // namespace mapkeep
