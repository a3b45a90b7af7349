#include "tests/bench/registration_cases.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "client/simulator/street_session.h"
#include "core/ratio_map/session_map.h"
#include "core/voxels/normal.h"

namespace mapkeep {
namespace {

constexpr double kMapVoxel = 0.2;
constexpr double kStart = 5;  // metres into the route at which the map begins
constexpr double kRadian = std::numbers::pi / 180;

SensorModel SensorOf(const std::string& name, const SuiteSize& size) {
  SensorModel sensor = SensorNamed(name).value();
  sensor.firings = std::max<size_t>(1, sensor.firings / size.thinner);
  return sensor;
}

SimulatedSession Drive(uint64_t street_seed, bool repeated, double changed, int session, DriveParameters drive,
                       double metres, const SuiteSize& size) {
  const auto street =
      MakeStreet({.seed = street_seed, .streets = size.streets, .repeated = repeated, .change_rate = changed});
  drive.speed = size.metres_per_scan / drive.sensor.period;
  drive.scans = static_cast<size_t>(metres / size.metres_per_scan);
  return DriveThrough(street.value(), session, drive).value();
}

// Turned and moved as a whole about the first scan.
Pose FrameOf(const RegistrationCase& of, std::mt19937_64& random) {
  const double bearing = std::uniform_real_distribution<double>(0, 2 * std::numbers::pi)(random);
  const double up = std::uniform_real_distribution<double>(-3, 3)(random);
  return Eigen::Translation3d(of.offset * std::cos(bearing), of.offset * std::sin(bearing), of.offset > 0 ? up : 0) *
         Eigen::AngleAxisd(of.yaw * kRadian, Eigen::Vector3d::UnitZ());
}

}  // namespace

std::vector<RegistrationCase> SuiteCases(size_t count, size_t foreign, size_t repeated) {
  std::vector<RegistrationCase> cases;
  std::mt19937_64 random(5);
  const auto any = [&](double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); };
  const auto draw = [&](RegistrationCase of) {
    of.yaw = any(0, 360);
    of.offset = any(0, 200);
    of.drift = any(0, 1);
    of.changed = any(0, 0.6);
    of.noise = any(0, 0.02);
    return of;
  };
  constexpr size_t kCasesAStreet = 10;
  for (size_t i = 0; i < count; ++i) {
    const uint64_t street = 1 + i / kCasesAStreet;
    RegistrationCase of = draw({.kind = "overlap", .map_street = street, .session_street = street});
    const char* sensors[] = {"hdl64", "vlp16", "os1-64", "vlp16"};
    of.sensor = sensors[i % 4];
    of.overlap = i % 3 == 0 ? 1.0 : any(0.3, 1);
    cases.push_back(of);
  }
  for (size_t i = 0; i < foreign; ++i) {
    RegistrationCase of = draw({.kind = "foreign", .map_street = 1, .session_street = 100 + i});
    of.sensor = i % 2 == 0 ? "hdl64" : "vlp16";
    // Half of them in their own frame, which begins as the map's does.
    if (i % 2 == 0) of.yaw = of.offset = 0;
    cases.push_back(of);
  }
  for (size_t i = 0; i < repeated; ++i) {
    RegistrationCase of = draw({.kind = "repeated", .map_street = 200, .session_street = 200, .repeated = true});
    if (i % 2 == 0) of.yaw = of.offset = 0;
    of.overlap = 1;
    cases.push_back(of);
  }
  return cases;
}

RegistrationTarget TargetFromScans(const SimulatedSession& session, const std::vector<Pose>& poses, double voxel_size) {
  const auto labels = [&](size_t i) { return session.labelled(i).value(); };
  std::vector<VoxelKey> keys;
  for (size_t i = 0; i < poses.size(); ++i) {
    const LabelledScan labelled = labels(i);
    for (size_t k = 0; k < labelled.labels.size(); ++k) {
      if (ClassOfLabel(labelled.labels[k]) == kMovingLabel) continue;
      keys.push_back(VoxelKeyOf(*VoxelIndexOf(poses[i] * labelled.scan.points[k].cast<double>(), voxel_size)));
    }
    std::ranges::sort(keys);
    keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
  }
  const Evidence evidence{voxel_size, keys, std::vector<uint32_t>(keys.size(), 1), std::vector<uint32_t>(keys.size())};
  const Labeller still = [&](size_t i, const Scan&) {
    std::vector<PointLabel> kept;
    for (const uint32_t label : labels(i).labels) {
      kept.push_back(ClassOfLabel(label) == kMovingLabel ? PointLabel::kDynamic : PointLabel::kStatic);
    }
    return kept;
  };
  const SessionMap map = BuildSessionMap(session.scans, poses, still, evidence, 0, {}).value();
  RegistrationTarget target{.voxel_size = voxel_size};
  for (const SessionVoxel& voxel : map.voxels) {
    const Eigen::Vector3d inside(voxel.mean[0] + 0.5, voxel.mean[1] + 0.5, voxel.mean[2] + 0.5);
    target.points.push_back(CornerOf(VoxelIndexOf(voxel.key), voxel_size) + inside * (voxel_size / 256));
    target.normals.push_back(DecodeNormal(voxel.normal));
  }
  return target;
}

SuiteMap MakeSuiteMap(const RegistrationCase& of, const SuiteSize& size, const MatcherParameters& matcher) {
  DriveParameters drive{.sensor = SensorOf("hdl64", size), .start = kStart};
  const SimulatedSession session = Drive(of.map_street, of.repeated, of.changed, 0, drive,
                                         of.repeated ? 100.0 * size.streets - 2 * kStart : size.map_metres, size);
  SuiteMap made;
  const Pose& first = session.truth.front();
  const double yaw = std::atan2(first.linear()(1, 0), first.linear()(0, 0));
  made.from_street =
      (Eigen::Translation3d(first.translation()) * Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ())).inverse();
  for (const Pose& pose : session.truth) made.poses.push_back(made.from_street * pose);
  RegistrationTarget target = TargetFromScans(session, made.poses, kMapVoxel);
  made.points = target.points.size();
  made.map = MapOf(std::move(target), matcher);
  return made;
}

SuiteSession MakeSuiteSession(const RegistrationCase& of, const SuiteSize& size, const SuiteMap& map, uint64_t seed) {
  DriveParameters drive{.sensor = SensorOf(of.sensor, size)};
  drive.odometry = {.drift = of.drift, .position_noise = of.noise, .rotation_noise = of.noise / 20};
  const double mapped = of.repeated ? 100.0 * size.streets - 2 * kStart : size.map_metres;
  std::mt19937_64 random(seed);
  if (of.kind == "repeated") {
    drive.start = std::uniform_real_distribution<double>(kStart + 50, mapped - size.session_metres - 40)(random);
  } else {
    const double latest = kStart + mapped - of.overlap * size.session_metres;
    drive.start = of.overlap >= 1 ? std::uniform_real_distribution<double>(0, latest)(random) : latest;
  }
  const SimulatedSession session = Drive(of.session_street, of.repeated, of.changed, 1 + static_cast<int>(seed % 3),
                                         drive, size.session_metres, size);
  const Pose frame = FrameOf(of, random);
  SuiteSession made{.scans = session.scans};
  for (const Pose& pose : session.odometry) made.poses.push_back(frame * pose);
  for (const Pose& pose : session.truth) made.truth.push_back(map.from_street * pose);
  return made;
}

}  // namespace mapkeep
