#include "client/simulator/measurement.h"

#include <gtest/gtest.h>

#include <cmath>

namespace mapkeep {
namespace {

SensorModel OneBeam(size_t firings) {
  return {.name = "one beam", .elevations = {0}, .firings = firings, .range_noise = 0.02, .drop_out = 0, .reach = 90};
}

/// Every ray hits the same surface of instance 0.
std::vector<RayHit> HitsOf(size_t count, float range, Material material = Material::kPlaster, float incidence = 1) {
  return std::vector<RayHit>(count, {.instance = 0, .range = range, .incidence = incidence, .material = material});
}

LabelledScan MeasureHits(const SensorModel& sensor, const std::vector<RayHit>& hits, uint64_t seed = 1) {
  const std::vector<Eigen::Vector3f> forward(hits.size(), Eigen::Vector3f::UnitX());
  return Measure(sensor, forward, hits, std::vector<uint32_t>{kStaticLabel, 5U << 16 | kMovingLabel}, seed);
}

struct Spread {
  double mean = 0, deviation = 0;
};

Spread SpreadOfRanges(const LabelledScan& measured) {
  Spread spread;
  const auto count = static_cast<double>(measured.scan.points.size());
  for (const Eigen::Vector3f& p : measured.scan.points) spread.mean += p.x() / count;
  double squares = 0;
  for (const Eigen::Vector3f& p : measured.scan.points) squares += std::pow(p.x() - spread.mean, 2) / count;
  spread.deviation = std::sqrt(squares);
  return spread;
}

TEST(Measurement, RangesSpreadAroundTheTruthByTheSensorsNoise) {
  constexpr size_t kRays = 20000;
  const LabelledScan measured = MeasureHits(OneBeam(kRays), HitsOf(kRays, 12));
  ASSERT_GT(measured.scan.points.size(), 0.99 * kRays);
  const Spread spread = SpreadOfRanges(measured);
  EXPECT_NEAR(spread.mean, 12, 0.001);
  EXPECT_NEAR(spread.deviation, 0.02, 0.001);
}

TEST(Measurement, AGrazedSurfaceIsNoisierThanOneMetHeadOn) {
  constexpr size_t kRays = 20000;
  const LabelledScan grazed = MeasureHits(OneBeam(kRays), HitsOf(kRays, 12, Material::kPlaster, 0.05F));
  ASSERT_GT(grazed.scan.points.size(), 0.9 * kRays);
  const Spread spread = SpreadOfRanges(grazed);
  EXPECT_NEAR(spread.mean, 12, 0.005);
  EXPECT_GT(spread.deviation, 0.04);
}

TEST(Measurement, HalfThePulsesComeBackFromATenPerCentTargetAtReach) {
  constexpr size_t kRays = 20000;
  const auto share = [&](float range) {
    const LabelledScan measured = MeasureHits(OneBeam(kRays), HitsOf(kRays, range, Material::kDarkPaint));  // 10 %
    return static_cast<double>(measured.scan.points.size()) / kRays;
  };
  EXPECT_NEAR(share(90), 0.5, 0.02);
  EXPECT_GT(share(20), 0.99);
}

TEST(Measurement, DropOutsAndGlassLoseTheirShare) {
  constexpr size_t kRays = 20000;
  SensorModel sensor = OneBeam(kRays);
  sensor.drop_out = 0.1;
  EXPECT_NEAR(static_cast<double>(MeasureHits(sensor, HitsOf(kRays, 10)).labels.size()) / kRays, 0.9, 0.01);
  sensor.drop_out = 0;
  EXPECT_NEAR(static_cast<double>(MeasureHits(sensor, HitsOf(kRays, 5, Material::kGlass)).labels.size()) / kRays, 0.2,
              0.01);
}

TEST(Measurement, OnlyAtAnEdgeDoBeamsReportARangeInBetweenAndTheyKeepTheLabelOfWhatTheyHit) {
  constexpr size_t kPairs = 10000;
  std::vector<RayHit> hits;
  for (size_t i = 0; i < kPairs; ++i) {
    hits.push_back({.instance = 1, .range = 10, .incidence = 1, .material = Material::kPlaster});
    hits.push_back({.instance = 0, .range = 11.5, .incidence = 1, .material = Material::kPlaster});
  }
  SensorModel sensor = OneBeam(2083);
  sensor.range_noise = 0;
  const LabelledScan measured = MeasureHits(sensor, hits);
  size_t between = 0;
  for (size_t i = 0; i < measured.labels.size(); ++i) {
    const float range = measured.scan.points[i].x();
    // A mixture is at most half way, so the label still tells the sides apart.
    EXPECT_EQ(ClassOfLabel(measured.labels[i]), range <= 10.75 ? kMovingLabel : kStaticLabel);
    if (range > 10.1 && range < 11.4) ++between;
  }
  EXPECT_GT(between, kPairs / 10);
  EXPECT_LT(between, kPairs);

  // A gap longer than the pulse gives two echoes, never one in between.
  for (RayHit& hit : hits) hit.range = hit.instance == 1 ? 10 : 20;
  for (const Eigen::Vector3f& point : MeasureHits(sensor, hits).scan.points) {
    EXPECT_TRUE(point.x() < 10.1 || point.x() > 19.9) << point.x();
  }
}

TEST(Measurement, IntensityFollowsTheMaterial) {
  const auto intensity = [](Material material) {
    return MeasureHits(OneBeam(1), HitsOf(1, 10, material)).scan.intensities.at(0);
  };
  EXPECT_NEAR(intensity(Material::kPlaster), 0.6, 0.08);
  EXPECT_NEAR(intensity(Material::kAsphalt), 0.17, 0.08);
  EXPECT_GT(intensity(Material::kReflector), 0.9);
}

}  // namespace
}  // namespace mapkeep
