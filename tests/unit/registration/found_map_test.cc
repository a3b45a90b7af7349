#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

#include "core/registration/aligner.h"
#include "tests/unit/registration/scene.h"

namespace mapkeep {
namespace {

using ::testing::HasSubstr;

// The street as seen from its own poses, which are then given in a frame tilted about x.
absl::StatusOr<Alignment> FoundedWithTilt(double degrees) {
  const auto truth = DriveAlong(0, 20, 1);
  const Pose tilt(Eigen::AngleAxisd(degrees * std::numbers::pi / 180, Eigen::Vector3d::UnitX()));
  std::vector<Pose> poses;
  for (const Pose& pose : truth) poses.push_back(tilt * pose);
  return FoundMapFrame(SourceOf(ScansOf(StreetOf(-30, 50), truth)), poses, {});
}

TEST(FoundMapFrame, TakesThePosesAsTheyAre) {
  for (const double degrees : {0.0, 4.0, -4.0}) {
    const auto alignment = FoundedWithTilt(degrees);
    ASSERT_TRUE(alignment.ok()) << alignment.status();
    EXPECT_TRUE(alignment->accepted) << alignment->reason;
    EXPECT_EQ(alignment->poses.size(), 21U);
  }
}

TEST(FoundMapFrame, RefusesAFrameThatDoesNotStandUprightAndSaysByHowMuch) {
  for (const double degrees : {8.0, 30.0, 90.0, 180.0}) {
    const auto alignment = FoundedWithTilt(degrees);
    ASSERT_TRUE(alignment.ok()) << alignment.status();
    EXPECT_FALSE(alignment->accepted);
    EXPECT_TRUE(alignment->poses.empty());
    const double said = std::stod(alignment->reason.substr(alignment->reason.find("z is ") + 5));
    EXPECT_NEAR(said, degrees, 0.6) << alignment->reason;
    EXPECT_THAT(alignment->reason, HasSubstr("at most 5.0 is allowed"));
  }
}

TEST(FoundMapFrame, AcceptsWhereThereIsTooLittleToTell) {
  const auto poses = DriveAlong(0, 5, 1);
  const auto alignment = FoundMapFrame(SourceOf(std::vector<Scan>(6, Scan{.points = {{1, 2, 3}}})), poses, {});
  ASSERT_TRUE(alignment.ok()) << alignment.status();
  EXPECT_TRUE(alignment->accepted);
}

TEST(FoundMapFrame, SaysWhatIsWrong) {
  EXPECT_TRUE(absl::IsInvalidArgument(FoundMapFrame(SourceOf(std::vector<Scan>(2)), DriveAlong(0, 5, 1), {}).status()));
  EXPECT_FALSE(FoundMapFrame(SourceOf({}), {}, {})->accepted);
  const auto poses = DriveAlong(0, 5, 1);
  const ScanSource torn{6, [](size_t) -> absl::StatusOr<Scan> { return absl::DataLossError("torn"); }};
  EXPECT_TRUE(absl::IsDataLoss(FoundMapFrame(torn, poses, {}).status()));
}

}  // namespace
}  // namespace mapkeep
