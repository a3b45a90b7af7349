#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/changes/block_change.h"
#include "core/changes/change_class.h"

namespace mapkeep {

/// When changed voxels are an object, and when only a better look at something known.
struct ChangedObjectParameters {
  double gap = 0.4;           ///< metres between voxels that still belong together (the larger of this and one voxel)
  double least_area = 1.2;    ///< square metres of surface: changed voxels times their edge squared
  double least_height = 0.5;  ///< metres between the lowest and the highest voxel
  double most_contact = 0.4;  ///< share of voxels that touch what stands in both states, beyond which it is that
                              ///< structure seen better, or less well
  double column_height = 4;   ///< metres below a voxel within which known ground says that its place was in view
  double least_length = 1.4;  ///< metres, the longer side seen from above: what is shorter are people who hardly moved
  double least_hits = 2;      ///< scans, mean over the voxels: what drove past far away was hit once in each place
  double least_in_view = 0.25;  ///< share of voxels whose place was in view before, for an object to have appeared

  /// Or, where the ground is hidden (cars behind a fence): what the earlier state knew around it, on two sides or
  /// more, and that it is seen well now. A street that is mapped for the first time has nothing known but at its end.
  double known_around = 3;      ///< metres
  int least_known_sides = 2;    ///< of four
  double least_hits_there = 3;  ///< scans, mean over the voxels
};

/// Changed voxels that hang together.
struct ChangedObject {
  ChangeClass change = ChangeClass::kAppeared;
  uint64_t voxels = 0;
  Eigen::AlignedBox3d box;                           ///< of the voxels, metres relative to the map's origin
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< mean of the voxels' means, likewise
  double hits = 0;     ///< mean over the voxels: scans that hit one, in the state that has it; at most 8 a voxel
  double contact = 0;  ///< share of the voxels that touch what stands in both states
  double in_view = 0;  ///< share of the voxels whose place was in view before
};

/// The voxel of one state of the map, or nullptr. Stays valid while the objects are being found.
using VoxelLookup = std::function<const Voxel*(VoxelKey key)>;

/// Groups the changed voxels that are not ground to objects, the largest first. What is too small or too flat, what is
/// only a better look at known structure, what appeared where nothing had been in view before, and what hardly any
/// voxel was hit of more than once, is left out. `changes` in order of key. What disappeared and what is unstable may
/// be one object (a car that left can be half gone): the class is that of most of its voxels.
std::vector<ChangedObject> FindChangedObjects(std::span<const BlockChange> changes, const VoxelLookup& before,
                                              const VoxelLookup& after, double voxel_size,
                                              const ChangedObjectParameters& parameters);

}  // namespace mapkeep
