// How well what stands upright fits.

#include "core/registration/structure.h"

#include <gtest/gtest.h>

#include "core/registration/parameters.h"
#include "core/registration/placement.h"

namespace mapkeep {
namespace {

// A wall in the plane x = 0 that faces +x, 8 m wide and 2 m high.
RegistrationTarget Wall() {
  RegistrationTarget target{.voxel_size = 0.2};
  for (int y = 0; y < 40; ++y) {
    for (int z = 0; z < 10; ++z) {
      target.points.emplace_back(0, 0.2 * y + 0.1, 0.2 * z + 0.1);
      target.normals.emplace_back(1, 0, 0);
    }
  }
  return target;
}

// Pieces of that wall, and half as many of one 50 m behind it.
PlanQuery Seen() {
  PlanQuery query;
  for (int y = 0; y < 20; ++y) {
    const Eigen::Vector3f place(0, 0.4F * static_cast<float>(y) + 0.1F, 0.9F);
    query.pieces.push_back({place, Eigen::Vector3f::UnitX()});
    if (y % 2 == 0) query.pieces.push_back({place - Eigen::Vector3f(50, 0, 0), Eigen::Vector3f::UnitX()});
  }
  return query;
}

StructureFit FitUnder(const Pose& pose, const PlanQuery& query = Seen()) {
  const Placer placer(Wall(), AlignParameters{});
  return placer.Structure(query, placer.PlanOfTarget(), pose);
}

TEST(StructureFitOf, CountsPiecesOnTheMapsSurfacesWhereTheMapIsKnown) {
  EXPECT_DOUBLE_EQ(FitUnder(Pose::Identity()).pieces, 1) << "what lies 50 m behind says nothing";
  EXPECT_DOUBLE_EQ(FitUnder(Pose(Eigen::Translation3d(0.1, 0, 0))).pieces, 1);
  EXPECT_DOUBLE_EQ(FitUnder(Pose(Eigen::Translation3d(0.3, 0, 0))).pieces, 0) << "off the wall by more than 0.15 m";
  // Half of the pieces go beyond the wall's end, where the map's cells of 2 m end with it.
  EXPECT_DOUBLE_EQ(FitUnder(Pose(Eigen::Translation3d(0, 4, 0))).pieces, 1);
}

TEST(StructureFitOf, TheBackOfAWallIsAnotherSurface) {
  PlanQuery turned = Seen();
  for (PlanQuery::Piece& piece : turned.pieces) piece.normal = -piece.normal;
  EXPECT_DOUBLE_EQ(FitUnder(Pose::Identity(), turned).pieces, 0);
}

TEST(StructureFitOf, AScoreNeedsBothViews) {
  EXPECT_DOUBLE_EQ((StructureFit{.walls = 0.5, .pieces = 0.4}.score()), 0.2);
  EXPECT_DOUBLE_EQ(FitUnder(Pose::Identity()).score(), 0) << "no walls were seen from above";
  PlanQuery query = Seen();
  for (int y = 0; y < 20; ++y) query.walls.push_back({0.0F, 0.4F * static_cast<float>(y) + 0.1F, 0.0F});
  EXPECT_DOUBLE_EQ(FitUnder(Pose::Identity(), query).walls, 1);
  EXPECT_DOUBLE_EQ(FitUnder(Pose::Identity(), query).score(), 1);
}

TEST(StructureFitOf, NothingFitsNothing) {
  EXPECT_DOUBLE_EQ(FitUnder(Pose::Identity(), {}).score(), 0);
  const Placer nowhere(RegistrationTarget{}, AlignParameters{});
  EXPECT_DOUBLE_EQ(nowhere.Structure(Seen(), nowhere.PlanOfTarget(), Pose::Identity()).score(), 0);
}

}  // namespace
}  // namespace mapkeep
