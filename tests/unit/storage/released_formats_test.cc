// What any released version has written is read for ever: a checked-in file of every version of every format
// (formats/<name>.<version>) must give what it was made of. A format whose version is raised needs a new file:
// MAPKEEP_RELEASE_FORMATS=1 storage_test --gtest_filter=ReleasedFormats.* writes those that are missing.

#include <gmock/gmock.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>
#include <string>

#include "storage/block_codec.h"
#include "storage/map_rows.h"
#include "storage/scan_codec.h"
#include "storage/session_codec.h"
#include "storage/tree_node.h"
#include "tests/unit/storage/status_matchers.h"

namespace mapkeep {
namespace {

/// A format: an example as the present version writes it, and whether bytes of any version are that example.
struct Format {
  std::string name;
  std::function<std::string()> encode;
  std::function<void(const std::string& bytes)> expect_example;
};

const BlockKey kBlock = BlockKeyOf(VoxelIndex{-3, 70, 2});

Block ExampleBlock() {
  return {kBlock,
          {{.position = 0,
            .hits = 8,
            .exposures = 1,
            .ground = true,
            .mean = {1, 2, 255},
            .normal = {128, 127},
            .intensity = 9,
            .mask = 0x8000000000000001,
            .first_seen = 14000000,
            .last_seen = 14000060},
           {.position = 300, .hits = 65535, .exposures = 65535, .is_static = true, .mean = {0, 128, 64}, .mask = 3},
           {.position = 32767,
            .hits = 2,
            .normal = {255, 0},
            .intensity = 255,
            .mask = 0x00ff00ff00ff00ff,
            .first_seen = 4294967295,
            .last_seen = 4294967295}}};
}

StagedScan ExampleScan() {
  StagedScan staged;
  staged.scan.points = {{1.5F, -2.25F, 1e-40F}, {-0.0F, 80.0F, -3.0F}};
  staged.scan.intensities = {0.25F, 1.0F};
  staged.scan.time = 1.79e9 + 0.125;
  staged.pose.translation() = Eigen::Vector3d(100.5, -7, 0.25);
  return staged;
}

TreeNode ExampleLeaf() {
  TreeNode leaf{.level = 0, .prefix = PrefixAt(0, kBlock)};
  leaf.children = {BlockChild(kBlock, {0xfedcba9876543210, 2}, 300, 200)};
  return leaf;
}

TreeNode ExampleDirectory() {
  TreeNode directory{.level = 1, .prefix = PrefixAt(1, kBlock)};
  directory.children = {ChildOf(ExampleLeaf(), {7, 0})};
  directory.children.front().slot = SlotAt(1, kBlock);
  return directory;
}

StoredSession ExampleSession() {
  StoredSession session;
  session.record = {.id = "drive-01",
                    .robot = "r2",
                    .state = SessionState::kRefused,
                    .keep_scans = true,
                    .durable_scans = 12,
                    .created = 1.79e9,
                    .ended = 1.79e9 + 60,
                    .start_time = 1.79e9 - 3600,
                    .reason = "no window reached tau_f",
                    .initial_pose = std::array<double, 4>{1, 2, 3, 0.5},
                    .lacks_map = true,
                    .retries = 2,
                    .turn = 1790000000000001};
  session.record.report = {.stages = {{"align", 1.5}}, .points = 1000000, .base_epoch = 4};
  session.incarnation = 0x0123456789abcdef;
  session.scan_count = 12;
  session.revision = 5;
  return session;
}

CommitRecord ExampleCommit() {
  return {.epoch = 5,
          .session = "drive-01",
          .base_epoch = 4,
          .attempt = AttemptName("drive-01", 0x1122334455667788),
          .time = 1.79e9,
          .touched_tiles = {TileKeyOf(kBlock)}};
}

void ExpectNode(const std::string& bytes, const TreeNode& expected) {
  const auto node = DecodeNode(bytes, {ValueKind(expected.level), expected.prefix, {}});
  ASSERT_DONE(node);
  EXPECT_EQ(node->prefix, expected.prefix);
  EXPECT_EQ(node->children, expected.children);
}

void ExpectScan(const std::string& bytes) {
  const auto scan = DecodeScan(bytes);
  ASSERT_DONE(scan);
  EXPECT_EQ(scan->scan.points, ExampleScan().scan.points);
  EXPECT_EQ(scan->scan.intensities, ExampleScan().scan.intensities);
  EXPECT_EQ(scan->scan.time, ExampleScan().scan.time);
  EXPECT_EQ(scan->pose.matrix(), ExampleScan().pose.matrix());
}

std::vector<Format> Formats() {
  return {
      {"block", [] { return *EncodeBlock(ExampleBlock()); },
       [](const std::string& bytes) {
         const auto block = DecodeBlock(bytes, kBlock);
         ASSERT_DONE(block);
         EXPECT_EQ(*block, ExampleBlock());
       }},
      {"scan", [] { return *EncodeScan(ExampleScan()); }, ExpectScan},
      {"scan", [] { return *EncodeScan(ExampleScan(), ScanForm::kPlain); }, ExpectScan},
      {"leaf", [] { return EncodeNode(ExampleLeaf()); },
       [](const std::string& bytes) { ExpectNode(bytes, ExampleLeaf()); }},
      {"directory", [] { return EncodeNode(ExampleDirectory()); },
       [](const std::string& bytes) { ExpectNode(bytes, ExampleDirectory()); }},
      {"session", [] { return EncodeSession(ExampleSession()); },
       [](const std::string& bytes) {
         const auto session = DecodeSession(bytes);
         ASSERT_DONE(session);
         EXPECT_EQ(session->record.state, SessionState::kRefused);
         EXPECT_EQ(session->record.reason, ExampleSession().record.reason);
         EXPECT_EQ(session->record.initial_pose, ExampleSession().record.initial_pose);
         EXPECT_EQ(EncodeSession(*session), EncodeSession(ExampleSession()));
       }},
      {"commit", [] { return EncodeRow(ExampleCommit()); },
       [](const std::string& bytes) {
         const auto commit = DecodeCommit(bytes);
         ASSERT_DONE(commit);
         EXPECT_EQ(EncodeRow(*commit), EncodeRow(ExampleCommit()));
         EXPECT_EQ(commit->touched_tiles, ExampleCommit().touched_tiles);
         EXPECT_EQ(commit->session, "drive-01");
       }},
  };
}

TEST(ReleasedFormats, AFileOfEveryVersionIsReadAsWhatItWasMadeOf) {
  for (const Format& format : Formats()) {
    SCOPED_TRACE(format.name);
    const std::string now = format.encode();
    const int newest = now[1];  // every format has its version there
    ASSERT_GE(newest, 1);
    for (int version = 1; version <= newest; ++version) {
      const std::string file = std::string(MAPKEEP_FORMATS "/") + format.name + "." + std::to_string(version);
      if (version == newest && !std::filesystem::exists(file) && std::getenv("MAPKEEP_RELEASE_FORMATS") != nullptr) {
        std::ofstream(file, std::ios::binary) << now;
      }
      std::ifstream in(file, std::ios::binary);
      ASSERT_TRUE(in) << file << " is missing: see the top of this test";
      std::ostringstream bytes;
      bytes << in.rdbuf();
      ASSERT_EQ(int{bytes.str().at(1)}, version) << file;
      format.expect_example(bytes.str());
    }
    format.expect_example(now);
  }
}

TEST(ReleasedFormats, AVersionOfTheFutureIsNamed) {
  for (const Format& format : Formats()) {
    std::string future = format.encode();
    ++future[1];
    if (format.name == "leaf") {
      const auto node = DecodeNode(future, {ValueKind(0), ExampleLeaf().prefix, {}});
      EXPECT_CODE(node, kDataLoss);
      EXPECT_THAT(std::string(node.status().message()), testing::HasSubstr("format version 2"));
    }
  }
}

}  // namespace
}  // namespace mapkeep
