// first_match_bench [--kilometres N] [--sensor NAME] [--matches N] [--full]
// How long it takes to find where a session lies, against N km of different streets (a seed each), and where that time
// goes: the stages of a first match beside what is made once for each state of the map. Scans are thinned and few
// unless --full; neither changes the size of a plan much. Prints wall and processor time; checks each place.

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <string>
#include <vector>

#include "client/simulator/street_session.h"
#include "core/registration/place_search.h"
#include "core/registration/plan_search.h"
#include "core/registration/query.h"
#include "core/registration/windows.h"
#include "tests/bench/registration_cases.h"

namespace mapkeep {
namespace {

constexpr double kApart = 400;  // metres between the streets
constexpr double kRoute = 980;  // metres that are driven of each

struct Kilometre {
  SimulatedSession drive;
  std::vector<Pose> poses;
  RegistrationTarget target;
  Eigen::AlignedBox3d box;
  std::shared_ptr<const PlanPart> plan;
};

struct Clock {
  std::chrono::steady_clock::time_point wall = std::chrono::steady_clock::now();
  std::clock_t processor = std::clock();
};

// A stage's times over all matches.
struct Stage {
  const char* name;
  double wall = 0, processor = 0;  // seconds

  void Add(const Clock& since) {
    wall += std::chrono::duration<double>(std::chrono::steady_clock::now() - since.wall).count();
    processor += static_cast<double>(std::clock() - since.processor) / CLOCKS_PER_SEC;
  }
};

DriveParameters DriveOf(const std::string& sensor, size_t thinner, double step, double start, double metres) {
  DriveParameters drive{.sensor = SensorNamed(sensor).value(), .start = start};
  drive.sensor.firings /= thinner;
  drive.speed = step / drive.sensor.period;
  drive.scans = static_cast<size_t>(metres / step);
  return drive;
}

int Run(int count, char** arguments) {
  size_t kilometres = 1, matches = 5;
  std::string sensor = "vlp16";
  bool full = false;
  CLI::App app("time of a first match");
  app.add_option("--kilometres", kilometres)->check(CLI::Range(1, 200));
  app.add_option("--sensor", sensor, "of the sessions; the map's is hdl64");
  app.add_option("--matches", matches);
  app.add_flag("--full", full, "every ray, a scan a metre");
  CLI11_PARSE(app, count, arguments);
  const size_t thinner = full ? 1 : 4;
  const double step = full ? 1 : 4;

  Stage describe{"plan of the map, once a state"}, join{"plan joined, once an epoch"};
  std::vector<Kilometre> site(kilometres);
  std::vector<std::shared_ptr<const PlanPart>> parts;
  size_t points = 0;
  for (size_t k = 0; k < kilometres; ++k) {
    Kilometre& km = site[k];
    const auto street = MakeStreet({.seed = 1000 + k, .streets = 10});
    km.drive = DriveThrough(street.value(), 0, DriveOf("hdl64", thinner, step, 5, kRoute)).value();
    const Pose place(Eigen::Translation3d(0, kApart * static_cast<double>(k), 0));
    for (const Pose& pose : km.drive.truth) km.poses.push_back(place * pose);
    km.target = TargetFromScans(km.drive, km.poses, 0.2);
    for (const Eigen::Vector3d& point : km.target.points) km.box.extend(point);
    points += km.target.points.size();
    const Clock clock;
    km.plan = std::make_shared<const PlanPart>(PlanOf(km.target.points, km.target.normals));
    describe.Add(clock);
    parts.push_back(km.plan);
  }
  const Clock joining;
  const auto plan = std::make_shared<const WallPlan>(parts);
  join.Add(joining);
  TargetMap map;
  map.plan = [&]() -> absl::StatusOr<std::shared_ptr<const WallPlan>> { return plan; };
  map.points = [&](std::span<const Eigen::AlignedBox3d> boxes) -> absl::StatusOr<RegistrationTarget> {
    RegistrationTarget near{.voxel_size = 0.2};
    for (const Kilometre& km : site) {
      for (const Eigen::AlignedBox3d& box : boxes) {
        if (!km.box.intersects(box)) continue;
        for (size_t i = 0; i < km.target.points.size(); ++i) {
          if (!box.contains(km.target.points[i])) continue;
          near.points.push_back(km.target.points[i]);
          near.normals.push_back(km.target.normals[i]);
        }
      }
    }
    return near;
  };

  Stage read{"scans cast and merged"}, above{"submap seen from above"}, search{"plan searched"},
      all{"FindPlace in all (the two before, refinement, verdict)"};
  AlignParameters parameters;
  parameters.match_descriptors = false;
  size_t right = 0, fits = 0;
  for (size_t m = 0; m < matches; ++m) {
    const size_t k = m * 7 % kilometres;
    const auto street = MakeStreet({.seed = 1000 + k, .streets = 10});
    const double start = 60 + 150.0 * static_cast<double>(m % 5);
    const auto drive = DriveThrough(street.value(), 1, DriveOf(sensor, 1, 1, start, 16)).value();
    const Clock reading;
    QueryBuilder queries(drive.scans, drive.odometry, parameters.source_voxel, parameters.query_range);
    const FacingPoints query = queries.QueryOf({0, drive.odometry.size() - 1}).value();
    read.Add(reading);
    const Clock seeing;
    const PlanQuery from_above = PlanQueryOf(query, parameters.plan);
    above.Add(seeing);
    const Clock searching;
    const auto places = SearchPlan(from_above, *plan, {}, parameters.plan);
    search.Add(searching);
    const Clock finding;
    const FoundPlace found = FindPlace(query, map, {}, {}, parameters).value();
    all.Add(finding);
    const Pose truth = Pose(Eigen::Translation3d(0, kApart * static_cast<double>(k), 0)) * drive.truth.front();
    const double off = (found.placement.pose.translation() - truth.translation()).norm();
    right += off < 0.5 ? 1 : 0;
    fits += found.fits ? 1 : 0;
    std::printf("match %zu: street %zu, %.2f m off, %s; walls %.2f, next %.2f %s\n", m, k, off,
                found.fits ? "fits" : "does not fit", places.empty() ? 0 : places[0].walls,
                places.size() < 2 ? 0 : places[1].walls, found.reason.c_str());
  }
  std::printf("%zu km, %zu static voxels; %zu of %zu places right, %zu fit\n", kilometres, points, right, matches,
              fits);
  const auto print = [](const Stage& stage, size_t times, double whole) {
    std::printf("  %-56s %8.1f ms wall %8.1f ms processor", stage.name, 1000 * stage.wall / static_cast<double>(times),
                1000 * stage.processor / static_cast<double>(times));
    if (whole > 0) std::printf("  %3.0f %%", 100 * stage.processor / whole);
    std::printf("\n");
  };
  print(describe, 1, 0);
  print(join, 1, 0);
  print(read, matches, 0);
  print(above, matches, all.processor);
  print(search, matches, all.processor);
  print(all, matches, all.processor);
  return right == matches ? 0 : 1;
}

}  // namespace
}  // namespace mapkeep

int main(int count, char** arguments) { return mapkeep::Run(count, arguments); }
