#include "client/simulator/sensor.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <cmath>
#include <numbers>

namespace mapkeep {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kDegree = kPi / 180;

void AddBeams(SensorModel& sensor, double first_degrees, double step_degrees, int count) {
  for (int i = 0; i < count; ++i) sensor.elevations.push_back((first_degrees + i * step_degrees) * kDegree);
}

SensorModel Hdl64() {
  SensorModel sensor{.name = "hdl64", .firings = 2083, .divergence = 0.0012};
  AddBeams(sensor, 2.0, -1.0 / 3, 32);  // the upper block
  AddBeams(sensor, -8.83, -0.5, 32);    // the lower block
  return sensor;
}

SensorModel Os1() {
  SensorModel sensor{.name = "os1-64",
                     .firings = 1024,
                     .height = 1.8,
                     .min_range = 0.5,
                     .max_range = 100,
                     .range_noise = 0.015,
                     .divergence = 0.003,
                     .reach = 60};
  AddBeams(sensor, 22.5, -45.0 / 63, 64);
  return sensor;
}

SensorModel Vlp16() {
  SensorModel sensor{.name = "vlp16",
                     .firings = 1808,
                     .height = 1.2,
                     .min_range = 0.5,
                     .max_range = 100,
                     .range_noise = 0.02,
                     .reach = 70};
  AddBeams(sensor, 15, -2, 16);
  return sensor;
}

SensorModel Livox() {
  SensorModel sensor{.name = "livox",
                     .firings = 4000,
                     .rosette = true,
                     .rosette_radius = 36 * kDegree,
                     .height = 1.5,
                     .min_range = 1.0,
                     .max_range = 150,
                     .range_noise = 0.02,
                     .divergence = 0.0025,
                     .reach = 110};
  AddBeams(sensor, 0.75, -0.3, 6);
  return sensor;
}

std::vector<SensorModel> Sensors() { return {Hdl64(), Os1(), Vlp16(), Livox()}; }

std::vector<Eigen::Vector3f> RosetteDirections(const SensorModel& sensor, size_t scan) {
  // Two Risley prisms of equal strength turn against one another; the ratio of their speeds is far from any fraction of
  // small numbers, so that the petals wander from scan to scan.
  constexpr double kFirstTurns = 121.57, kSecondTurns = -77.73;  // a second
  std::vector<Eigen::Vector3f> directions;
  directions.reserve(sensor.firings * sensor.elevations.size());
  for (size_t i = 0; i < sensor.firings; ++i) {
    const double time = (static_cast<double>(scan) + static_cast<double>(i) / sensor.firings) * sensor.period;
    const double a = 2 * kPi * std::fmod(kFirstTurns * time, 1.0), b = 2 * kPi * std::fmod(kSecondTurns * time, 1.0);
    const double azimuth = sensor.rosette_radius / 2 * (std::cos(a) + std::cos(b));
    const double elevation = sensor.rosette_radius / 2 * (std::sin(a) + std::sin(b));
    for (const double offset : sensor.elevations) {
      const double e = elevation + offset;
      directions.emplace_back(std::cos(e) * std::cos(azimuth), std::cos(e) * std::sin(azimuth), std::sin(e));
    }
  }
  return directions;
}

}  // namespace

std::vector<std::string> SensorNames() {
  std::vector<std::string> names;
  for (const SensorModel& sensor : Sensors()) names.push_back(sensor.name);
  return names;
}

absl::StatusOr<SensorModel> SensorNamed(std::string_view name) {
  for (SensorModel& sensor : Sensors()) {
    if (sensor.name == name) return sensor;
  }
  return absl::InvalidArgumentError(absl::StrCat("no sensor is called '", std::string(name), "': expected one of ",
                                                 absl::StrJoin(SensorNames(), ", ")));
}

std::vector<Eigen::Vector3f> DirectionsOf(const SensorModel& sensor, size_t scan, double phase) {
  if (sensor.rosette) return RosetteDirections(sensor, scan);
  std::vector<Eigen::Vector2f> channels;  // cosine and sine of the elevations
  for (const double e : sensor.elevations) channels.emplace_back(std::cos(e), std::sin(e));
  std::vector<Eigen::Vector3f> directions;
  directions.reserve(sensor.firings * channels.size());
  for (size_t i = 0; i < sensor.firings; ++i) {
    // Heads turn clockwise and begin at the back, as KITTI's scans do.
    const double azimuth = kPi - 2 * kPi * (static_cast<double>(i) + phase) / static_cast<double>(sensor.firings);
    const auto c = static_cast<float>(std::cos(azimuth)), s = static_cast<float>(std::sin(azimuth));
    for (const Eigen::Vector2f& e : channels) directions.emplace_back(e.x() * c, e.x() * s, e.y());
  }
  return directions;
}

}  // namespace mapkeep
