#include "core/scan_payload/scan_payload.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>
#include <random>

namespace mapkeep {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

const Scan kScan{.points = {{1, 2, 3}, {4, 5, 6}}, .intensities = {0.5F, 1.F}};

/// What a 64-beam sensor 1.8 m above ground sees between walls, ring by ring, with noise: as real scans are ordered.
Scan Sweep(size_t columns) {
  std::mt19937 random(7);
  std::normal_distribution<float> noise(0, 0.01F);
  std::uniform_real_distribution<float> intensity(0, 1);
  Scan scan;
  for (int ring = 0; ring < 64; ++ring) {
    const double pitch = (2.0 - 26.8 * ring / 63) * std::numbers::pi / 180;
    for (size_t column = 0; column < columns; ++column) {
      const double yaw = 2 * std::numbers::pi * static_cast<double>(column) / static_cast<double>(columns);
      const Eigen::Vector3d ray(std::cos(pitch) * std::cos(yaw), std::cos(pitch) * std::sin(yaw), std::sin(pitch));
      const double to_wall = 20 / std::max(std::abs(ray.x()) / 3, std::abs(ray.y()));
      const double to_ground = ray.z() < 0 ? -1.8 / ray.z() : to_wall;
      const Eigen::Vector3f point = (std::min(to_wall, to_ground) * ray).cast<float>();
      scan.points.push_back(point + Eigen::Vector3f(noise(random), noise(random), noise(random)));
      scan.intensities.push_back(std::round(100 * intensity(random)) / 100);
    }
  }
  return scan;
}

Scan RoundTrip(const Scan& scan, ScanEncoding encoding, size_t* bytes = nullptr) {
  const auto payload = EncodePayload(scan, encoding);
  EXPECT_TRUE(payload.ok()) << payload.status();
  if (bytes != nullptr) *bytes = payload->size();
  EXPECT_LE(payload->size(), LargestPayload(static_cast<uint32_t>(scan.points.size()), FormatOf(encoding)));
  auto decoded = DecodePayload(*payload, FormatOf(encoding), static_cast<uint32_t>(scan.points.size()));
  EXPECT_TRUE(decoded.ok()) << decoded.status();
  return decoded.ok() ? *decoded : Scan();
}

TEST(ScanPayload, RawPointsTravelAsFourFloats) {
  const std::string bytes = *EncodePayload(kScan, ScanEncoding::kRaw);
  ASSERT_EQ(bytes.size(), 32U);
  std::vector<float> numbers(8);
  std::memcpy(numbers.data(), bytes.data(), bytes.size());
  EXPECT_THAT(numbers, ElementsAre(1, 2, 3, 0.5F, 4, 5, 6, 1));
  Scan unknown = kScan;
  unknown.intensities.clear();
  std::memcpy(numbers.data(), EncodePayload(unknown, ScanEncoding::kRaw)->data(), bytes.size());
  EXPECT_THAT(numbers, ElementsAre(1, 2, 3, 0, 4, 5, 6, 0));
  EXPECT_EQ(RoundTrip(kScan, ScanEncoding::kRaw).points, kScan.points);
}

TEST(ScanPayload, ADracoScanIsOffByHalfAStepAtMostAndKeepsTheOrderOfItsPoints) {
  const Scan scan = Sweep(500);
  for (const auto& [encoding, step] : {std::pair(ScanEncoding::kDraco1Cm, 0.01), {ScanEncoding::kDraco1Mm, 0.001}}) {
    const Scan decoded = RoundTrip(scan, encoding);
    ASSERT_EQ(decoded.points.size(), scan.points.size());
    float worst = 0, worst_intensity = 0;
    for (size_t i = 0; i < scan.points.size(); ++i) {
      worst = std::max(worst, (decoded.points[i] - scan.points[i]).cwiseAbs().maxCoeff());
      worst_intensity = std::max(worst_intensity, std::abs(decoded.intensities[i] - scan.intensities[i]));
    }
    EXPECT_LE(worst, 0.5 * step + 2e-5) << "float32 is that coarse at 60 m";
    EXPECT_LE(worst_intensity, 0.5F / 255 + 1e-6F);
  }
}

TEST(ScanPayload, AScanOf120ThousandPointsWithIntensityTakesAtMost300KilobytesAtOneCentimetre) {
  size_t bytes = 0;
  const Scan scan = Sweep(1875);
  ASSERT_EQ(scan.points.size(), 120'000U);
  RoundTrip(scan, ScanEncoding::kDraco1Cm, &bytes);
  EXPECT_LE(bytes, 300'000U);
  EXPECT_EQ(*EncodePayload(scan, ScanEncoding::kDraco1Cm), *EncodePayload(scan, ScanEncoding::kDraco1Cm));
}

TEST(ScanPayload, AFewPointsAndPointsInOnePlaceAreFine) {
  for (const ScanEncoding encoding : {ScanEncoding::kRaw, ScanEncoding::kDraco1Cm, ScanEncoding::kDraco1Mm}) {
    EXPECT_EQ(RoundTrip({.points = {{1, 2, 3}}, .intensities = {1}}, encoding).points.size(), 1U);
    EXPECT_EQ(RoundTrip({.points = std::vector<Eigen::Vector3f>(5000, {-4, 5, 6})}, encoding).points.size(), 5000U);
    const Scan far = RoundTrip({.points = {{-9000, 9000, 0}, {9000, -9000, 100}}}, encoding);
    EXPECT_NEAR(far.points[1].x(), 9000, 0.01);
  }
}

TEST(ScanPayload, WhatCannotBeQuantisedIsRefusedByItsPoint) {
  const auto complaint = [](Scan scan) {
    return std::string(EncodePayload(scan, ScanEncoding::kDraco1Cm).status().message());
  };
  Scan scan = kScan;
  scan.points[1].y() = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(complaint(scan), HasSubstr("point 1 is not finite"));
  scan = kScan;
  scan.intensities[0] = 1.5F;
  EXPECT_THAT(complaint(scan), HasSubstr("point 0 has intensity 1.5"));
  scan = kScan;
  scan.points[0].x() = 3e9F;
  EXPECT_THAT(complaint(scan), HasSubstr("steps of 0.01 m"));
  EXPECT_THAT(complaint({}), HasSubstr("no points"));
}

TEST(ScanPayload, DamagedBytesAreErrorsOrPointsButNeverMore) {
  const Scan scan = Sweep(20);
  const auto count = static_cast<uint32_t>(scan.points.size());
  for (const ScanEncoding encoding : {ScanEncoding::kRaw, ScanEncoding::kDraco1Cm}) {
    const std::string payload = *EncodePayload(scan, encoding);
    EXPECT_FALSE(DecodePayload(payload, FormatOf(encoding), count + 1).ok());
    EXPECT_FALSE(DecodePayload(payload + "x", FormatOf(encoding), count).ok());
    for (size_t size = 0; size < payload.size(); size += 7) {
      EXPECT_FALSE(DecodePayload(payload.substr(0, size), FormatOf(encoding), count).ok()) << size;
    }
    std::mt19937 random(3);
    for (int round = 0; round < 2000; ++round) {
      std::string damaged = payload;
      damaged[random() % damaged.size()] ^= static_cast<char>(1 << random() % 8);
      const auto decoded = DecodePayload(damaged, FormatOf(encoding), count);
      if (decoded.ok()) {
        EXPECT_EQ(decoded->points.size(), count);
      }
    }
  }
}

TEST(ScanPayload, AClaimOfManyPointsIsCheckedBeforeAnyMemoryIsTaken) {
  std::string payload = *EncodePayload(kScan, ScanEncoding::kDraco1Cm);
  const uint32_t many = 4'000'000'000;
  std::memcpy(payload.data() + 11, &many, sizeof many);
  EXPECT_THAT(DecodePayload(payload, PayloadFormat::kDraco, 2).status().message(), HasSubstr("byte 11"));
}

}  // namespace
}  // namespace mapkeep
