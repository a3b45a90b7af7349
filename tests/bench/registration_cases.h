#pragma once

#include <memory>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "client/simulator/session.h"
#include "core/registration/aligner.h"

namespace mapkeep {

/// What a case of the registration suite asks for.
struct RegistrationCase {
  std::string kind;              ///< overlap, foreign or repeated
  uint64_t map_street = 1;       ///< seeds of the streets that were mapped
  uint64_t session_street = 1;   ///< and that the session drives through
  bool repeated = false;         ///< every block of the street is a copy of the first
  std::string sensor = "hdl64";  ///< of the session; the map's is always hdl64
  double overlap = 1;            ///< share of the session's way that the map's session drove as well
  double yaw = 0;                ///< degrees that the session's frame is turned
  double offset = 0;             ///< metres that it is moved
  double drift = 0;              ///< metres a 100 m
  double changed = 0.3;          ///< share of parked cars that are elsewhere
  double noise = 0;              ///< metres of white noise on odometry positions
};

/// How large the scans of a suite are and how long its drives.
struct SuiteSize {
  size_t thinner = 1;       ///< only one of this many firings of the sensors
  int streets = 3;          ///< blocks of 100 m
  double map_metres = 150;  ///< driven by the session that made the map, from the start of the street
  double session_metres = 100;
  double metres_per_scan = 1;
};

/// `count` overlapping cases over all of the ranges, `foreign` sessions from other streets and `repeated` from
/// a street whose blocks are copies. The same for the same arguments.
std::vector<RegistrationCase> SuiteCases(size_t count, size_t foreign, size_t repeated);

/// A map that one session made, and its frame: that of its founder, who began at the origin with yaw 0.
struct SuiteMap {
  TargetMap map;
  Pose from_street = Pose::Identity();
  std::vector<Pose> poses;  ///< of the scans that made it, map frame
  size_t points = 0;
};
SuiteMap MakeSuiteMap(const RegistrationCase& of, const SuiteSize& size, const MatcherParameters& matcher);

/// A session and where its scans truly lie in the frame of the map.
struct SuiteSession {
  ScanSource scans;
  std::vector<Pose> poses;  ///< as uploaded
  std::vector<Pose> truth;  ///< map frame; means nothing for a foreign session
};
SuiteSession MakeSuiteSession(const RegistrationCase& of, const SuiteSize& size, const SuiteMap& map, uint64_t seed);

/// Static voxels of scans at known poses: those that any point that does not move fell into.
RegistrationTarget TargetFromScans(const SimulatedSession& session, const std::vector<Pose>& poses, double voxel_size);

}  // namespace mapkeep
