#include "client/readers/frames.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/unit/client/session_files.h"

namespace mapkeep {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(Frames, BothEndsAreIncludedAndTheStepIsOneByDefault) {
  const absl::StatusOr<FrameRange> range = ParseFrames("38:76");
  ASSERT_TRUE(range.ok()) << range.status();
  EXPECT_EQ(range->first, 38U);
  EXPECT_EQ(range->last, 76U);
  EXPECT_EQ(range->step, 1U);
  EXPECT_EQ(ParseFrames("0:9:3")->step, 3U);
}

TEST(Frames, WhatIsNoRangeIsRefused) {
  for (const char* text : {"", "5", "5:", ":5", "a:b", "1:2:3:4", "-1:5", "1:2:", "1.5:2", "1:99999999999", "+1:2"}) {
    EXPECT_THAT(std::string(ParseFrames(text).status().message()), HasSubstr("expected FIRST:LAST")) << text;
  }
  EXPECT_THAT(std::string(ParseFrames("5:4").status().message()), HasSubstr("LAST is before FIRST"));
  EXPECT_THAT(std::string(ParseFrames("4:5:0").status().message()), HasSubstr("STEP is 0"));
}

TEST(Frames, SelectsScansWithTheirPosesAndTimes) {
  const TemporaryDirectory directory;
  WriteKittiSession(directory.path(), 6);
  WriteText(directory.path() / "times.txt", "2000000000\n2000000001\n2000000002\n2000000003\n2000000004\n2000000005\n");
  const absl::StatusOr<SessionDirectory> whole = OpenSessionDirectory(directory.path());
  ASSERT_TRUE(whole.ok()) << whole.status();
  const absl::StatusOr<SessionDirectory> some = SelectFrames(*whole, {.first = 1, .last = 5, .step = 2});
  ASSERT_TRUE(some.ok()) << some.status();
  std::vector<std::string> names;
  for (const auto& file : some->files) names.push_back(file.filename().string());
  EXPECT_THAT(names, ElementsAre("000001.bin", "000003.bin", "000005.bin"));
  EXPECT_EQ(some->poses[1].translation().x(), 3);
  EXPECT_EQ(ReadScan(*some, 2)->scan.time, 2000000005);
}

TEST(Frames, ARangeBeyondTheEndIsRefused) {
  const TemporaryDirectory directory;
  WriteKittiSession(directory.path(), 3);
  const absl::StatusOr<SessionDirectory> whole = OpenSessionDirectory(directory.path());
  ASSERT_TRUE(whole.ok()) << whole.status();
  EXPECT_THAT(std::string(SelectFrames(*whole, {.first = 0, .last = 3}).status().message()),
              HasSubstr("frame 3 is beyond the last one, 2"));
}

}  // namespace
}  // namespace mapkeep
