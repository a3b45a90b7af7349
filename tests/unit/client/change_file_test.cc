#include "client/exporters/change_file.h"

#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace mapkeep {
namespace {

TEST(ChangeFile, PointsAreGreenWhereTheyAppearedRedWhereTheyDisappearedOrangeWhereTheyAreUnstable) {
  const std::filesystem::path path = std::filesystem::temp_directory_path() / "mapkeep-change-file-test.ply";
  auto writer = ChangeFileWriter::Create(path, "from here to there");
  ASSERT_TRUE(writer.ok()) << writer.status();
  writer->Add({1, 2, 3}, ChangeClass::kAppeared);
  writer->Add({4, 5, 6}, ChangeClass::kDisappeared);
  writer->Add({7, 8, 9}, ChangeClass::kUnstable);
  EXPECT_EQ(writer->count(), 3U);
  ASSERT_TRUE(writer->Finish().ok());
  std::ifstream file(path, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(file), {}};
  std::filesystem::remove(path);
  EXPECT_NE(bytes.find("comment from here to there\nelement vertex 3\n"), std::string::npos);
  const std::string end = "end_header\n";
  const std::string points = bytes.substr(bytes.find(end) + end.size());
  ASSERT_EQ(points.size(), 3 * 15U);
  float x = 0;
  std::memcpy(&x, points.data() + 15, sizeof x);
  EXPECT_EQ(x, 4);
  const auto channel = [&points](size_t at) { return static_cast<unsigned char>(points[at]); };
  EXPECT_GT(channel(13), channel(12)) << "green above red";
  EXPECT_GT(channel(27), channel(28)) << "red above green";
  EXPECT_GT(channel(42), channel(43)) << "orange is red,";
  EXPECT_GT(channel(43), channel(44)) << "then green, then blue";
}

TEST(ChangeFile, OnlyPlyHasColours) { EXPECT_FALSE(ChangeFileWriter::Create("change.pcd", "").ok()); }

}  // namespace
}  // namespace mapkeep
