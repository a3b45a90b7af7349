#include "core/registration/windows.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace mapkeep {
namespace {

using ::testing::ElementsAre;

constexpr AlignParameters kDefaults;  // L 30 scans or 15 m, r 10

std::vector<Pose> Drive(size_t scans, double step) {
  std::vector<Pose> poses;
  for (size_t i = 0; i < scans; ++i) poses.emplace_back(Eigen::Translation3d(step * static_cast<double>(i), 0, 0));
  return poses;
}

TEST(Windows, HoldLScansEveryR) {
  EXPECT_THAT(WindowsOf(Drive(52, 0.1), kDefaults),
              ElementsAre(Window{0, 29}, Window{10, 39}, Window{20, 49}, Window{30, 51}));
}

TEST(Windows, EndAfterTheTravelIfThatComesFirst) {
  // 15 m at 1.5 m a scan: 11 scans, the next window 6 later.
  EXPECT_THAT(WindowsOf(Drive(20, 1.5), kDefaults), ElementsAre(Window{0, 10}, Window{6, 16}, Window{12, 19}));
}

TEST(Windows, CoverEveryScanOnceAtLeastAndOverlap) {
  for (const double step : {0.0, 0.5, 1.0, 2.6, 7.0, 40.0}) {
    for (const size_t scans : {1U, 2U, 29U, 31U, 300U}) {
      const auto windows = WindowsOf(Drive(scans, step), kDefaults);
      ASSERT_FALSE(windows.empty());
      EXPECT_EQ(windows.front().first, 0U);
      EXPECT_EQ(windows.back().last, scans - 1);
      for (size_t u = 1; u < windows.size(); ++u) {
        EXPECT_GT(windows[u].first, windows[u - 1].first);
        EXPECT_LE(windows[u].first, windows[u - 1].last + 1);
      }
    }
  }
  EXPECT_TRUE(WindowsOf({}, kDefaults).empty());
}

TEST(Windows, NonsenseParametersStillEnd) {
  EXPECT_THAT(WindowsOf(Drive(3, 1), {.window_scans = 0, .window_stride = -4}),
              ElementsAre(Window{0, 0}, Window{1, 1}, Window{2, 2}));
}

}  // namespace
}  // namespace mapkeep
