#include "client/mapkeep/scan_checksums.h"

#include <absl/strings/str_format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "core/checksum/crc32c.h"

namespace mapkeep {
namespace {

using ::testing::ElementsAre;

const Scan kScan{.points = {{1, 2, 3}, {4, 5, 6}}, .intensities = {0.5F, 1.F}, .time = 1.75e9};

std::string Payload(const Scan& scan, ScanEncoding encoding = ScanEncoding::kRaw) {
  return *EncodePayload(scan, encoding);
}

/// A source of 100 scans of which some cannot be read.
ScanSource WithBadScans(const std::vector<size_t>& bad) {
  return {100, [bad](size_t index) -> absl::StatusOr<Scan> {
            for (const size_t i : bad) {
              if (i == index) return absl::InvalidArgumentError(absl::StrFormat("scan %d is bad", i));
            }
            return kScan;
          }};
}

TEST(ScanChecksums, CoverPointsThenPoseThenTime) {
  Pose pose = Pose::Identity();
  pose.translation() = Eigen::Vector3d(7, 8, 9);
  const double numbers[13] = {1, 0, 0, 7, 0, 1, 0, 8, 0, 0, 1, 9, 1.75e9};
  const std::string all = Payload(kScan) + std::string(reinterpret_cast<const char*>(numbers), sizeof(numbers));
  EXPECT_EQ(ScanChecksum(Payload(kScan), pose, kScan.time), Crc32c(all));
}

TEST(ScanChecksums, AreOfThePayloadAsItIsSent) {
  const std::vector<Pose> poses(1, Pose::Identity());
  const auto checksums = ScanChecksums(SourceOf({kScan}), poses, {}, ScanEncoding::kDraco1Cm);
  ASSERT_TRUE(checksums.ok()) << checksums.status();
  EXPECT_THAT(*checksums, ElementsAre(ScanChecksum(Payload(kScan, ScanEncoding::kDraco1Cm), poses[0], kScan.time)));
  Scan bad = kScan;
  bad.intensities[1] = 2;
  const auto refused =
      ScanChecksums(SourceOf({kScan, bad}), std::vector<Pose>(2, Pose::Identity()), {}, ScanEncoding::kDraco1Mm);
  EXPECT_EQ(refused.status().message(), "scan 1: point 1 has intensity 2, expected a value in [0, 1]");
}

TEST(ScanChecksums, OneAScanInOrder) {
  std::vector<Pose> poses(3, Pose::Identity());
  poses[1].translation().x() = 1;
  const auto checksums = ScanChecksums(SourceOf({kScan, kScan, kScan}), poses);
  ASSERT_TRUE(checksums.ok()) << checksums.status();
  const std::string bytes = Payload(kScan);
  EXPECT_THAT(*checksums,
              ElementsAre(ScanChecksum(bytes, poses[0], kScan.time), ScanChecksum(bytes, poses[1], kScan.time),
                          ScanChecksum(bytes, poses[2], kScan.time)));
}

TEST(ScanChecksums, TheFirstBadScanIsTheOneReported) {
  const std::vector<Pose> poses(100, Pose::Identity());
  for (int repetition = 0; repetition < 20; ++repetition) {
    const auto checksums = ScanChecksums(WithBadScans({90, 31, 32, 55}), poses);
    EXPECT_EQ(checksums.status(), absl::InvalidArgumentError("scan 31 is bad"));
  }
}

TEST(ScanChecksums, StopWhenTheListenerSaysSo) {
  const std::vector<Pose> poses(100, Pose::Identity());
  const auto checksums = ScanChecksums(WithBadScans({}), poses, [](double fraction) { return fraction < 0.5; });
  EXPECT_TRUE(absl::IsCancelled(checksums.status())) << checksums.status();
}

TEST(ScanChecksums, ProgressNeverFallsAndEndsAtOne) {
  const std::vector<Pose> poses(100, Pose::Identity());
  double last = 0;
  const auto checksums = ScanChecksums(WithBadScans({}), poses, [&last](double fraction) {
    EXPECT_GE(fraction, last);
    last = fraction;
    return true;
  });
  EXPECT_TRUE(checksums.ok()) << checksums.status();
  EXPECT_EQ(last, 1);
}

}  // namespace
}  // namespace mapkeep
