#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <span>
#include <vector>

#include "core/geometry/pose.h"
#include "core/registration/match_cloud.h"
#include "core/registration/wall_plan.h"

namespace mapkeep {

/// How a plan is searched.
struct PlanSearchParameters {
  double voxel_size = 0.5;     ///< metres: the submap is thinned to this before its walls are taken
  double normal_radius = 3;    ///< voxels: neighbours that make a normal
  size_t walls = 720;          ///< pieces of wall that are compared with the map, at most
  size_t coarse_walls = 240;   ///< of them, at first
  size_t pieces = 1500;        ///< upright pieces by which a place is judged, at most
  double coarse_turn = 4;      ///< degrees between the headings that are tried at first
  size_t coarse_places = 240;  ///< of the first round that the second one takes,
  size_t fine_places = 48;     ///< of the second one that the third takes
  size_t candidates = 8;       ///< that remain
  double apart = 2.5;          ///< metres, and
  double apart_turn = 8;       ///< degrees by which places differ that are not the same
};

/// A submap seen from straight above.
struct PlanQuery {
  struct Wall {
    float x = 0, y = 0;  ///< metres from `middle`
    float facing = 0;    ///< radians from x towards y
  };
  /// A piece of something upright, in the submap's frame.
  struct Piece {
    Eigen::Vector3f point = Eigen::Vector3f::Zero();
    Eigen::Vector3f normal = Eigen::Vector3f::Zero();  ///< unit, towards the free side
  };
  Eigen::Matrix3d level = Eigen::Matrix3d::Identity();  ///< turns the submap's frame upright
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();     ///< a place on its floor, metres, turned upright
  std::vector<Wall> walls;              ///< rare facings as good as frequent ones; any first few are as mixed as all
  std::vector<Eigen::Vector3f> floors;  ///< the lowest floor a floor cell, metres from `middle`
  std::vector<Piece> pieces;            ///< at any height, drawn like walls
};

/// What is to be found of a submap, in the frame of a sensor that stands roughly upright: ground and walls tell how far
/// it leans.
PlanQuery PlanQueryOf(const FacingPoints& submap, const PlanSearchParameters& parameters);

/// Of the walls that lie where the map has a floor or a wall nearby, under `pose` (T_map_submap): the share that a wall
/// meets which faces the same way (half: one in a cell beside).
double WallsMet(const PlanQuery& query, const WallPlan& plan, const Pose& pose);

/// A place where a submap may lie.
struct PlanPlace {
  Pose pose = Pose::Identity();  ///< T_map_submap, to about a cell and a degree
  double walls = 0;              ///< share of the query's walls where the map has a wall that faces the same way
  double floors = 0;             ///< share of the query's floors that the map has at the same height
};

/// Where the submap looks most like the map from above, best first: every place with a floor, or those in the box (x
/// and y count), and every heading, from coarse to fine. Parallel on the calling oneTBB arena; the same on any number
/// of threads.
std::vector<PlanPlace> SearchPlan(const PlanQuery& query, const WallPlan& plan,
                                  const std::optional<Eigen::AlignedBox3d>& within,
                                  const PlanSearchParameters& parameters);

}  // namespace mapkeep
