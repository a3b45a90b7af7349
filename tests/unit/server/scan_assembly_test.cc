#include "server/rpc/scan_assembly.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <limits>
#include <vector>

#include "core/checksum/crc32c.h"
#include "core/scan_payload/scan_payload.h"

namespace mapkeep {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr std::array<double, 12> kIdentity = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};

std::string Bytes(const std::vector<float>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float)};
}

// As a client makes it: the checksum is that of the content.
RawScan Raw(const std::vector<float>& values, double time = 1e9, std::array<double, 12> rows = kIdentity) {
  RawScan raw;
  raw.value += Bytes(values);
  raw.header.set_index(3);
  raw.header.set_point_count(static_cast<uint32_t>(values.size() / 4));
  raw.header.mutable_pose()->mutable_rows()->Add(rows.begin(), rows.end());
  raw.header.set_time(time);
  uint32_t crc = Crc32c(raw.payload());
  crc = Crc32c({reinterpret_cast<const char*>(rows.data()), sizeof rows}, crc);
  raw.header.set_crc32c(Crc32c({reinterpret_cast<const char*>(&time), sizeof time}, crc));
  return raw;
}

absl::Status Refusal(const RawScan& raw) { return CheckScan(raw, raw.header.crc32c(), {.voxel_size = 0.2}).status(); }

// What it is staged as, if it is.
StagedScan Staged(const absl::StatusOr<PlainScan>& checked) {
  EXPECT_TRUE(checked.ok()) << checked.status();
  return *DecodeScan(checked->value);
}

absl::Status Append(ScanAssembly& assembly, std::string_view chunk) { return assembly.Append({&chunk, 1}); }

// The same, compressed.
RawScan Compressed(const std::string& payload, uint32_t points) {
  RawScan raw = Raw(std::vector<float>(4 * points));
  raw.value.replace(kScanContentAt, std::string::npos, payload);
  raw.header.set_format(v1::POINT_FORMAT_DRACO);
  raw.header.set_payload_bytes(static_cast<uint32_t>(payload.size()));
  const double time = raw.header.time();
  uint32_t crc = Crc32c(payload);
  crc = Crc32c({reinterpret_cast<const char*>(kIdentity.data()), sizeof kIdentity}, crc);
  raw.header.set_crc32c(Crc32c({reinterpret_cast<const char*>(&time), sizeof time}, crc));
  return raw;
}

v1::ScanHeader Header(uint32_t points) {
  v1::ScanHeader header;
  header.set_point_count(points);
  return header;
}

TEST(ScanAssembly, ChunksOfAnySizeMakeTheScan) {
  const std::string bytes = Bytes({1, 2, 3, 0.5, 4, 5, 6, 1});
  for (size_t size = 1; size <= bytes.size(); ++size) {
    ScanAssembly assembly;
    ASSERT_TRUE(assembly.Begin(Header(2)).ok());
    for (size_t at = 0; at < bytes.size(); at += size) {
      EXPECT_FALSE(assembly.complete());
      ASSERT_TRUE(Append(assembly, bytes.substr(at, size)).ok());
    }
    ASSERT_TRUE(assembly.complete());
    EXPECT_EQ(assembly.Take().payload(), bytes);
    EXPECT_FALSE(assembly.under_way());
  }
}

TEST(ScanAssembly, AChunkMayComeInPieces) {
  const std::string bytes = Bytes({1, 2, 3, 0.5, 4, 5, 6, 1});
  const std::string_view all = bytes;
  ScanAssembly assembly;
  ASSERT_TRUE(assembly.Begin(Header(2)).ok());
  ASSERT_TRUE(assembly.Append(std::vector{all.substr(0, 5), all.substr(5, 1), all.substr(6)}).ok());
  ASSERT_TRUE(assembly.complete());
  EXPECT_EQ(assembly.Take().payload(), bytes);
}

TEST(ScanAssembly, ClaimsDoNotTakeMemory) {
  ScanAssembly assembly;
  ASSERT_TRUE(assembly.Begin(Header(4'000'000)).ok());
  EXPECT_EQ(assembly.bytes(), 0U);
  EXPECT_TRUE(absl::IsInvalidArgument(ScanAssembly().Begin(Header(200'000'000))));  // 3 GiB
  EXPECT_TRUE(absl::IsInvalidArgument(ScanAssembly().Begin(Header(0))));
}

TEST(ScanAssembly, WhatIsOutOfOrderIsRefused) {
  ScanAssembly assembly;
  EXPECT_THAT(std::string(Append(assembly, "x").message()), HasSubstr("header comes first"));
  ASSERT_TRUE(assembly.Begin(Header(1)).ok());
  EXPECT_THAT(std::string(assembly.Begin(Header(1)).message()), HasSubstr("has 0 of 16 bytes"));
  EXPECT_THAT(std::string(Append(assembly, std::string(17, 'x')).message()), HasSubstr("more than the 16 bytes"));
  ScanAssembly large;
  ASSERT_TRUE(large.Begin(Header(1'000'000)).ok());
  EXPECT_THAT(std::string(Append(large, std::string((1 << 20) + 1, 'x')).message()), HasSubstr("at most 1 MiB"));
}

TEST(CheckScan, WhatIsStagedIsWhatTheClientSent) {
  std::array<double, 12> moved = kIdentity;
  moved[3] = 7;
  const RawScan raw = Raw({1, 2, 3, 0.5, -4, 5, 6, 1}, 1e9, moved);
  const StagedScan staged = Staged(CheckScan(raw, raw.header.crc32c(), {.voxel_size = 0.2}));
  EXPECT_EQ(staged.scan.points, (std::vector<Eigen::Vector3f>{{1, 2, 3}, {-4, 5, 6}}));
  EXPECT_EQ(staged.scan.intensities, (std::vector<float>{0.5, 1}));
  EXPECT_EQ(staged.scan.time, 1e9);
  EXPECT_EQ(staged.pose.translation(), Eigen::Vector3d(7, 0, 0));
}

TEST(CheckScan, ContentThatIsNotWhatTheChecksumSaysIsDataLoss) {
  RawScan raw = Raw({1, 2, 3, 0.5});
  raw.value.back() = static_cast<char>(raw.value.back() ^ 1);
  const absl::Status status = Refusal(raw);
  EXPECT_TRUE(absl::IsDataLoss(status));
  EXPECT_THAT(std::string(status.message()), HasSubstr("scan 3"));
}

TEST(CheckScan, AScanOtherThanPromisedIsRefused) {
  const RawScan raw = Raw({1, 2, 3, 0.5});
  const absl::Status status = CheckScan(raw, raw.header.crc32c() + 1, {.voxel_size = 0.2}).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status));
  EXPECT_THAT(std::string(status.message()), AllOf(HasSubstr("scan 3"), HasSubstr("promised")));
}

TEST(CheckScan, BadValuesAreNamedByScanAndPoint) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  const auto complaint = [](const std::vector<float>& values) {
    const absl::Status status = Refusal(Raw(values));
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
    return std::string(status.message());
  };
  EXPECT_THAT(complaint({1, 2, 3, 0, 1, kNan, 3, 0}), AllOf(HasSubstr("scan 3"), HasSubstr("point 1 is not finite")));
  EXPECT_THAT(complaint({1, 2, kInfinity, 0}), HasSubstr("point 0 is not finite"));
  EXPECT_THAT(complaint({1, 2, 3, kNan}), HasSubstr("point 0 is not finite"));
  EXPECT_THAT(complaint({1, 2, 3, 255}), HasSubstr("intensity 255"));
  EXPECT_THAT(complaint({1, 2, 3, 0, 3e5, 0, 0, 0}), AllOf(HasSubstr("point 1"), HasSubstr("beyond the map's range")));
}

TEST(CheckScan, TheRangeIsThatOfTheMovedPointAboutTheMapsOrigin) {
  std::array<double, 12> far = kIdentity;
  far[3] = 690000;
  const RawScan raw = Raw({1, 2, 3, 0}, 0, far);
  EXPECT_TRUE(absl::IsInvalidArgument(Refusal(raw)));
  const MapRange range{.voxel_size = 0.2, .origin = {690000, 0, 0}};
  EXPECT_TRUE(CheckScan(raw, raw.header.crc32c(), range).ok());
}

TEST(CheckScan, BadPosesAndTimesAreRefused) {
  std::array<double, 12> stretched = kIdentity;
  stretched[0] = 2;
  EXPECT_THAT(std::string(Refusal(Raw({1, 2, 3, 0}, 0, stretched)).message()), HasSubstr("not a rotation"));
  EXPECT_THAT(std::string(Refusal(Raw({1, 2, 3, 0}, -1)).message()), HasSubstr("time -1"));
}

TEST(CheckScan, CompressedPointsAreStagedAsWhatTheyDecodeTo) {
  const Scan scan{.points = {{1, 2, 3}, {4, 5, 6}}, .intensities = {0.2F, 1}};
  const std::string payload = *EncodePayload(scan, ScanEncoding::kDraco1Cm);
  const RawScan raw = Compressed(payload, 2);
  const auto checked = CheckScan(raw, raw.header.crc32c(), {.voxel_size = 0.2});
  EXPECT_EQ(Staged(checked).scan.points, DecodePayload(payload, PayloadFormat::kDraco, 2)->points);
  EXPECT_EQ(checked->payload_bytes, payload.size());
  EXPECT_THAT(Refusal(Compressed(payload.substr(0, payload.size() - 1), 2)).message(), HasSubstr("scan 3: Draco"));
  RawScan damaged = raw;
  damaged.value[kScanContentAt + 40] ^= 1;
  EXPECT_EQ(Refusal(damaged).code(), absl::StatusCode::kDataLoss);
}

TEST(ScanAssembly, APayloadIsAsLongAsItsHeaderSays) {
  v1::ScanHeader header = Header(1000);
  header.set_payload_bytes(15'999);
  EXPECT_THAT(ScanAssembly().Begin(header).message(), HasSubstr("payload_bytes 15999"));
  header.set_format(v1::POINT_FORMAT_DRACO);
  ScanAssembly assembly;
  ASSERT_TRUE(assembly.Begin(header).ok());
  ASSERT_TRUE(Append(assembly, std::string(15'999, 'x')).ok());
  EXPECT_TRUE(assembly.complete());
  header.set_payload_bytes(16'000 + 4097);
  EXPECT_THAT(ScanAssembly().Begin(header).message(), HasSubstr("expected 1 to 20096"));
  header.set_payload_bytes(0);
  EXPECT_FALSE(ScanAssembly().Begin(header).ok());
  header.set_format(static_cast<v1::PointFormat>(9));
  EXPECT_THAT(ScanAssembly().Begin(header).message(), HasSubstr("point format 9"));
}

TEST(ScanAssembly, AFewBytesCountAsWhatTheyMayBecome) {
  RawScan raw = Compressed("few", 1000);
  EXPECT_EQ(raw.DecodedBytes(), 16'000U);
}

}  // namespace
}  // namespace mapkeep
