#include "tests/bench/removal_scenes.h"

#include <absl/strings/str_format.h>

#include <numbers>

#include "client/simulator/car_park.h"
#include "client/simulator/street_session.h"

namespace mapkeep {
namespace {

constexpr int kSimulatorVersion = 3;  // raise it when the simulator gives other points or labels for the same scene

}  // namespace

std::vector<RemovalScene> RemovalScenes() {
  return {
      {.name = "hdl64-street", .seed = 11},
      {.name = "hdl64-crowd-fine", .voxel_size = 0.1, .start = 10, .seed = 12, .crowd = 40},
      {.name = "hdl64-stop-and-go-3cm", .scans = 180, .seed = 13, .position_noise = 0.03, .stop_and_go = true},
      {.name = "hdl64-waiting-cars", .scans = 260, .speed = 1.5, .start = 20, .seed = 14, .waiting_cars = 3},
      {.name = "os1-car-park-tenth-degree",
       .sensor = "os1-64",
       .scans = 160,
       .speed = 3,
       .seed = 15,
       .rotation_noise_degrees = 0.1,
       .car_park = true},
      {.name = "os1-standing-crowd-fine",
       .sensor = "os1-64",
       .voxel_size = 0.1,
       .speed = 0,
       .start = 40,
       .seed = 16,
       .crowd = 30},
      {.name = "os1-stop-and-go-coarse-3cm",
       .sensor = "os1-64",
       .voxel_size = 0.4,
       .scans = 180,
       .seed = 17,
       .position_noise = 0.03,
       .stop_and_go = true},
      {.name = "vlp16-street", .sensor = "vlp16", .scans = 160, .seed = 18},
      {.name = "vlp16-waiting-cars-tenth-degree",
       .sensor = "vlp16",
       .scans = 260,
       .speed = 1.5,
       .start = 30,
       .seed = 19,
       .rotation_noise_degrees = 0.1,
       .waiting_cars = 3},
      {.name = "vlp16-crowd-coarse",
       .sensor = "vlp16",
       .voxel_size = 0.4,
       .scans = 160,
       .speed = 2,
       .start = 20,
       .seed = 20,
       .crowd = 40},
      {.name = "livox-street", .sensor = "livox", .scans = 160, .seed = 21},
      {.name = "livox-stop-and-go-coarse-tenth-degree",
       .sensor = "livox",
       .voxel_size = 0.4,
       .scans = 180,
       .seed = 22,
       .rotation_noise_degrees = 0.1,
       .stop_and_go = true},
  };
}

std::string DescriptionOf(const RemovalScene& scene) {
  return absl::StrFormat(
      "%d %s %s scans %d speed %g start %g seed %d noise %g %g crowd %d density %g stop %d waiting %d %g deck %d",
      kSimulatorVersion, scene.name, scene.sensor, scene.scans, scene.speed, scene.start, scene.seed,
      scene.position_noise, scene.rotation_noise_degrees, scene.crowd, scene.density, scene.stop_and_go,
      scene.waiting_cars, scene.wait, scene.car_park);
}

absl::StatusOr<SimulatedSession> SimulateScene(const RemovalScene& scene) {
  const absl::StatusOr<SensorModel> sensor = SensorNamed(scene.sensor);
  if (!sensor.ok()) return sensor.status();
  DriveParameters drive{.sensor = *sensor, .scans = scene.scans, .speed = scene.speed, .start = scene.start};
  drive.odometry.position_noise = scene.position_noise;
  drive.odometry.rotation_noise = scene.rotation_noise_degrees * std::numbers::pi / 180;
  drive.traffic = {
      .density = scene.density, .crowd = scene.crowd, .stop_and_go = scene.stop_and_go, .wait = scene.wait};
  if (scene.car_park) {
    const absl::StatusOr<CarPark> car_park = MakeCarPark({.seed = scene.seed});
    if (!car_park.ok()) return car_park.status();
    return DriveThroughCarPark(*car_park, 0, drive);
  }
  const absl::StatusOr<Street> street = MakeStreet({.seed = scene.seed, .waiting_cars = scene.waiting_cars});
  if (!street.ok()) return street.status();
  return DriveThrough(*street, 0, drive);
}

}  // namespace mapkeep
