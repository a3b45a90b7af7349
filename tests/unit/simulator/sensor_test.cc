#include "client/simulator/sensor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace mapkeep {
namespace {

using ::testing::HasSubstr;

constexpr double kDegree = 0.017453292519943295;

TEST(Sensor, AnUnknownNameIsRefusedWithTheNamesThatThereAre) {
  const auto sensor = SensorNamed("hdl32");
  ASSERT_FALSE(sensor.ok());
  EXPECT_THAT(std::string(sensor.status().message()), HasSubstr("'hdl32'"));
  EXPECT_THAT(std::string(sensor.status().message()), HasSubstr("hdl64, os1-64, vlp16, livox"));
}

TEST(Sensor, DirectionsAreUnitVectorsOneAFiringAndChannel) {
  for (const std::string& name : SensorNames()) {
    const SensorModel sensor = *SensorNamed(name);
    const auto directions = DirectionsOf(sensor, 3, 0.5);
    ASSERT_EQ(directions.size(), sensor.firings * sensor.elevations.size()) << name;
    for (const Eigen::Vector3f& d : directions) ASSERT_NEAR(d.norm(), 1, 1e-5) << name;
  }
}

TEST(Sensor, Hdl64LooksAllAroundBetween2And24Point3Degrees) {
  const auto directions = DirectionsOf(*SensorNamed("hdl64"), 0, 0);
  float lowest = 1, highest = -1;
  std::array<int, 4> quarters{};
  for (const Eigen::Vector3f& d : directions) {
    lowest = std::min(lowest, d.z());
    highest = std::max(highest, d.z());
    ++quarters[(d.x() > 0 ? 1 : 0) + (d.y() > 0 ? 2 : 0)];
  }
  EXPECT_NEAR(std::asin(lowest), -24.33 * kDegree, 1e-4);
  EXPECT_NEAR(std::asin(highest), 2 * kDegree, 1e-4);
  for (const int count : quarters) EXPECT_NEAR(count, 64 * 2083 / 4, 64 * 2);
}

TEST(Sensor, TheRosetteLooksForwardAndFillsItsFieldOverSeveralScans) {
  const SensorModel livox = *SensorNamed("livox");
  const auto filled = [&](size_t scans) {
    std::vector<bool> cells(71 * 71);
    for (size_t scan = 0; scan < scans; ++scan) {
      for (const Eigen::Vector3f& d : DirectionsOf(livox, scan, 0)) {
        const double azimuth = std::atan2(d.y(), d.x()) / kDegree, elevation = std::asin(d.z()) / kDegree;
        EXPECT_LT(std::hypot(azimuth, elevation), 38);
        if (std::abs(azimuth) < 35 && std::abs(elevation) < 35) {
          cells[static_cast<size_t>(azimuth + 35) * 71 + static_cast<size_t>(elevation + 35)] = true;
        }
      }
    }
    return std::count(cells.begin(), cells.end(), true);
  };
  EXPECT_GT(filled(10), 1.05 * static_cast<double>(filled(1)));
}

}  // namespace
}  // namespace mapkeep
