// Tables 2 and 3 of the paper on a small folder in the layout of the KTH benchmark.

#include "tests/bench/paper_table_2_3.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "client/simulator/session_files.h"
#include "client/simulator/street_session.h"
#include "tests/unit/client/session_files.h"

namespace mapkeep {
namespace {

using ::testing::HasSubstr;

TEST(ScoreByNearestKept, APointIsKeptWhenAKeptOneLiesWithinFiveCentimetres) {
  Scan truth;
  truth.points = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {-3, 0, 0}, {4, 0, 0}};
  truth.intensities = {0, 0, 1, 1, 1};
  const std::vector<Eigen::Vector3f> kept = {{0.049F, 0, 0}, {1.04F, 0.04F, 0}, {2, 0, -0.049F}, {-3.06F, 0, 0}};
  const RemovalScore score = ScoreByNearestKept(truth, kept);
  EXPECT_EQ(score.statics, 2U);
  EXPECT_EQ(score.kept, 1U) << "the second is 5.7 cm off";
  EXPECT_EQ(score.moving, 3U);
  EXPECT_EQ(score.removed, 2U);
}

TEST(PaperTables, AFolderOfTheBenchmarkGivesOurRowsBesideThePapers) {
  const TemporaryDirectory directory;
  const auto street = MakeStreet({.seed = 3});
  ASSERT_TRUE(street.ok()) << street.status();
  const auto session = DriveThrough(*street, 0, {.sensor = *SensorNamed("vlp16"), .scans = 40});
  ASSERT_TRUE(session.ok()) << session.status();
  const std::filesystem::path folder = directory.path() / "street";
  ASSERT_TRUE(WriteSession(*session, folder, SessionLayout::kKth).ok());

  const absl::StatusOr<KthTables> tables = TablesOfKthFolder(folder);
  ASSERT_TRUE(tables.ok()) << tables.status();
  EXPECT_EQ(tables->name, "street");
  EXPECT_EQ(tables->scans, 40U);
  ASSERT_EQ(tables->ablation.size(), AblationSteps().size());
  size_t moving = 0, statics = 0;
  for (size_t i = 0; i < session->scans.count; ++i) {
    const auto labelled = session->labelled(i);
    for (const uint32_t label : labelled->labels) {
      moving += ClassOfLabel(label) == kMovingLabel ? 1 : 0;
      statics += ClassOfLabel(label) == kStaticLabel ? 1 : 0;
    }
  }
  for (const AblationRow& row : tables->ablation) {
    EXPECT_EQ(row.score.moving, moving) << row.name;
    EXPECT_EQ(row.score.statics, statics) << row.name;
  }
  EXPECT_GT(tables->ablation.back().score.sa(), 95);
  EXPECT_GT(tables->ablation.back().score.da(), 60);

  const std::string text = PrintedTables({&*tables, 1});
  EXPECT_THAT(text, HasSubstr("ELite++ (paper)"));
  EXPECT_THAT(text, HasSubstr("Mapkeep"));
  EXPECT_THAT(text, HasSubstr("+ clusters"));
}

TEST(PaperTables, AFolderWithoutItsTruthIsNamed) {
  const TemporaryDirectory directory;
  const auto tables = TablesOfKthFolder(directory.path());
  ASSERT_FALSE(tables.ok());
  EXPECT_THAT(std::string(tables.status().message()), HasSubstr(directory.path().string()));
}

}  // namespace
}  // namespace mapkeep
