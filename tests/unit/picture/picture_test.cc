#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "client/picture/colouring.h"
#include "client/picture/drawing.h"
#include "client/picture/top_view.h"

namespace mapkeep {
namespace {

// One voxel of edge 0.2 m, all 64 sub-voxels occupied.
Voxel FullVoxel(const VoxelIndex& index, bool is_static = true) {
  return {
      .position = PositionInBlock(index), .hits = 80, .exposures = 80, .is_static = is_static, .mask = ~uint64_t{0}};
}

TEST(TopView, KeepsTheHighestStaticPointOfEveryCell) {
  TopView view = MakeTopView({0, 0}, {2, 1}, 0.1);
  ASSERT_EQ(view.width, 20);
  ASSERT_EQ(view.height, 10);
  Block block{BlockKeyOf(VoxelIndex{0, 0, 0}),
              {FullVoxel({1, 2, 0}), FullVoxel({1, 2, 5}), FullVoxel({5, 2, 9}, false)}};
  AddBlock(block, 0.2, view);
  int occupied = 0;
  for (const TopView::Cell& cell : view.cells) occupied += cell.occupied;
  EXPECT_EQ(occupied, 4);
  EXPECT_NEAR(view.At(2, 4).z, 5 * 0.2 + 0.175, 1e-6);
  EXPECT_NEAR(view.At(3, 5).stability, 0.5, 1e-3);
  EXPECT_FALSE(view.At(10, 4).occupied) << "a voxel that is not static was drawn";
}

TEST(TopView, IsCroppedToWhatItShows) {
  TopView view = MakeTopView({-10, -10}, {10, 10}, 0.1);
  AddBlock({BlockKeyOf(VoxelIndex{0, 0, 0}), {FullVoxel({0, 0, 0})}}, 0.2, view);
  const TopView cropped = Cropped(view, 3);
  EXPECT_EQ(cropped.width, 8);
  EXPECT_EQ(cropped.height, 8);
  EXPECT_NEAR(cropped.corner.x(), -0.3, 1e-9);
  EXPECT_TRUE(cropped.At(3, 3).occupied);
  EXPECT_TRUE(Cropped(MakeTopView({0, 0}, {1, 1}, 0.1), 3).cells.empty());
}

TEST(Colouring, SpansTheHeightsThatAreThere) {
  TopView view = MakeTopView({0, 0}, {1, 1}, 0.1);
  for (size_t i = 0; i < view.cells.size(); ++i) view.cells[i] = {.z = static_cast<float>(i), .occupied = true};
  const Colouring colouring = ColouringOf(view, PictureColour::kHeight);
  EXPECT_NEAR(colouring.low, 0, 1);
  EXPECT_NEAR(colouring.high, 98, 1);
  EXPECT_EQ(ColourOf(view.cells.front(), colouring), RampColour(0));
  EXPECT_EQ(ColourOf(view.cells.back(), colouring), RampColour(1));
}

TEST(Colouring, TellsGroundFromTheRestAndOldFromNew) {
  TopView view = MakeTopView({0, 0}, {0.2, 0.1}, 0.1);
  view.cells = {{.last_seen = 0, .ground = true, .occupied = true}, {.last_seen = 4 * 24 * 60, .occupied = true}};
  const Colouring ground = ColouringOf(view, PictureColour::kGround);
  EXPECT_EQ(ColourOf(view.cells[0], ground), ground.classes[0].colour);
  EXPECT_EQ(ColourOf(view.cells[1], ground), ground.classes[1].colour);
  const Colouring age = ColouringOf(view, PictureColour::kAge);
  EXPECT_DOUBLE_EQ(age.high - age.low, 4);
  EXPECT_EQ(ColourOf(view.cells[1], age), RampColour(1));
}

TEST(Drawing, AxesStepByOneTwoOrFive) {
  EXPECT_DOUBLE_EQ(TickStep(0.8), 1);
  EXPECT_DOUBLE_EQ(TickStep(1.2), 2);
  EXPECT_DOUBLE_EQ(TickStep(20), 20);
  EXPECT_DOUBLE_EQ(TickStep(21), 50);
  EXPECT_DOUBLE_EQ(TickStep(60), 100);
}

TEST(Drawing, WritesAPngOrSaysWhyNot) {
  TopView view = MakeTopView({0, 0}, {30, 20}, 0.1);
  AddBlock({BlockKeyOf(VoxelIndex{0, 0, 0}), {FullVoxel({3, 3, 0})}}, 0.2, view);
  const Colouring colouring = ColouringOf(view, PictureColour::kHeight);
  const std::string path = testing::TempDir() + "/picture_test.png";
  ASSERT_TRUE(DrawPicture(view, colouring, "yard, epoch 3", path).ok());
  std::string head(8, '\0');
  std::ifstream(path, std::ios::binary).read(head.data(), 8);
  EXPECT_EQ(head, "\x89PNG\r\n\x1a\n");
  std::filesystem::remove(path);

  EXPECT_TRUE(absl::IsUnavailable(DrawPicture(view, colouring, "", "/nowhere/at/all.png")));
  view.width = 40000;
  EXPECT_TRUE(absl::IsResourceExhausted(DrawPicture(view, colouring, "", path)));
}

}  // namespace
}  // namespace mapkeep
