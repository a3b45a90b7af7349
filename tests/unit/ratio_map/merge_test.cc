#include "core/ratio_map/merge.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/ratio_map/map_filter.h"
#include "core/voxels/normal.h"

namespace mapkeep {
namespace {

const BlockKey kBlock = BlockKeyOf(VoxelIndex{0, 0, 0});
constexpr MergeParameters kDefaults;

SessionMap SessionOf(std::vector<SessionVoxel> voxels, double n_max, uint32_t start = 100) {
  return {.voxel_size = 0.2, .start_minutes = start, .n_max = n_max, .voxels = std::move(voxels)};
}

Block Merged(const Block& old, const SessionMap& session, const MergeParameters& parameters = kDefaults) {
  return MergeBlock(old, session.voxels, session, parameters);
}

// A block with one voxel at position 7 merged with one session voxel there; the voxel, or none.
std::vector<Voxel> MergedVoxels(const Voxel& old, SessionVoxel session, double n_max,
                                const MergeParameters& parameters = kDefaults) {
  session.key = VoxelKeyOf(kBlock, 7);
  Voxel placed = old;
  placed.position = 7;
  return Merged({kBlock, {placed}}, SessionOf({session}, n_max), parameters).voxels;
}

Voxel OnlyVoxel(const Voxel& old, const SessionVoxel& session, double n_max,
                const MergeParameters& parameters = kDefaults) {
  const auto voxels = MergedVoxels(old, session, n_max, parameters);
  EXPECT_EQ(voxels.size(), 1U);
  return voxels.empty() ? Voxel{} : voxels[0];
}

TEST(DecayFactor, IsEquation8) {
  // gamma 4, N_S 5 of N_max 20: exp(-1) = 0.3679. N_S 20: exp(-4) = 0.018, held at alpha_min. N_S 0.1: exp(-0.02) =
  // 0.980, held at alpha_max.
  EXPECT_NEAR(DecayFactor(5, 20, kDefaults), 0.367879, 4e-5);
  EXPECT_DOUBLE_EQ(DecayFactor(20, 20, kDefaults), 0.1);
  EXPECT_DOUBLE_EQ(DecayFactor(0.1, 20, kDefaults), 0.95);
  EXPECT_DOUBLE_EQ(DecayFactor(1000, 20, kDefaults), 0.1);
}

TEST(DecayFactor, FollowsTheExponentialEverywhere) {
  const MergeParameters open{.gamma = 1, .alpha_min = 0, .alpha_max = 1};
  for (double x = 0; x < 20; x += 0.0137) EXPECT_NEAR(DecayFactor(x, 1, open), std::exp(-x), 4e-5) << x;
}

TEST(DecayFactor, HasAnAnswerWithoutAMaximum) {
  EXPECT_DOUBLE_EQ(DecayFactor(3, 0, kDefaults), 0.1);
  EXPECT_DOUBLE_EQ(DecayFactor(0, 0, kDefaults), 0.95);
}

TEST(Merge, AddsDecayedHistoryAndTheSession) {
  // Equation 9 by hand: H 40, E 8 scans; H_S 4, E_S 1 of N_max 20: alpha = exp(-4 * 5 / 20) = 0.36788 (the table's).
  // H = 0.36788 * 40 + 4 = 18.715 scans = 149.72 eighths -> 150; E = 0.36788 * 8 + 1 = 3.943 = 31.54 -> 32.
  const Voxel merged = OnlyVoxel({.hits = 320, .exposures = 64}, {.hits = 4, .exposures = 1}, 20);
  EXPECT_EQ(merged.hits, 150);
  EXPECT_EQ(merged.exposures, 32);
}

TEST(Merge, RoundsHalfToEven) {
  const MergeParameters half{.gamma = 4, .alpha_min = 0.5, .alpha_max = 0.5};
  // 5 / 2 = 2.5 -> 2 and 7 / 2 = 3.5 -> 4 eighths; E gains one scan.
  const Voxel merged = OnlyVoxel({.hits = 5, .exposures = 7}, {.exposures = 1}, 20, half);
  EXPECT_EQ(merged.hits, 2);
  EXPECT_EQ(merged.exposures, 4 + 8);
}

// Eq. 8 alone, without the rule of contradiction.
constexpr MergeParameters kDecayAlone{.contradicting_scans = 0};

TEST(Merge, OneContrarySessionOfEqualWeightHidesAVoxel) {
  // 20 scans hit it on Monday, 20 scans look through it on Tuesday, N_max = 20: alpha = 0.1, H = 2, E = 20 scans.
  const Voxel merged = OnlyVoxel({.hits = 160}, {.exposures = 20}, 20, kDecayAlone);
  EXPECT_EQ(merged.hits, 16);
  EXPECT_EQ(merged.exposures, 160);
  EXPECT_LT(Stability(merged.hits, merged.exposures, 0), MapFilterParameters{}.stability_threshold);
}

TEST(Merge, AFewScansThroughWhatIsNotThereAnyMoreForgetIt) {
  // Hit in 40 scans over the days, now looked through in three of the 60 that count elsewhere.
  const Voxel old{.hits = 320, .exposures = 8};
  EXPECT_TRUE(MergedVoxels(old, {.exposures = 3}, 60).empty());
  const Voxel tenth = OnlyVoxel(old, {.exposures = 3}, 60, {.contradicted_alpha = 0.1});
  EXPECT_EQ(tenth.hits, 32);
  EXPECT_EQ(tenth.exposures, 24 + 1);
  // So it is if something else moved there: what stood there cannot. Two may be chance, and eq. 8 alone keeps nearly
  // all.
  EXPECT_TRUE(MergedVoxels(old, {.exposures = 3, .was_removed = true}, 60).empty());
  EXPECT_GT(OnlyVoxel(old, {.exposures = 2}, 60).hits, 270);
  EXPECT_GT(OnlyVoxel(old, {.exposures = 3}, 60, kDecayAlone).hits, 250);
}

TEST(Merge, AVoxelBelowAQuarterScanIsDropped) {
  // alpha = 0.1: 24 eighths become 2.4 -> 2 = 1/4 scan and stay; 14 become 1.4 -> 1 and go.
  EXPECT_EQ(MergedVoxels({.hits = 24}, {.exposures = 20}, 20, kDecayAlone).size(), 1U);
  EXPECT_TRUE(MergedVoxels({.hits = 14}, {.exposures = 20}, 20, kDecayAlone).empty());
}

TEST(Merge, WhatTheSessionDidNotSeeStaysAsItWas) {
  const Block old{kBlock, {{.position = 3, .hits = 99, .first_seen = 5}, {.position = 9, .hits = 8}}};
  EXPECT_EQ(Merged(old, SessionOf({}, 20)), old);
  // Nor does a session voxel without evidence change anything.
  EXPECT_EQ(Merged(old, SessionOf({{.key = VoxelKeyOf(kBlock, 3)}}, 20)), old);
}

TEST(Merge, AVoxelNeverHitIsNotMade) {
  EXPECT_TRUE(Merged({.key = kBlock}, SessionOf({{.key = VoxelKeyOf(kBlock, 3), .exposures = 12}}, 20)).voxels.empty());
}

TEST(Merge, ANewVoxelIsTheSessionsOwn) {
  const SessionVoxel seen{.key = VoxelKeyOf(kBlock, 31),
                          .hits = 3,
                          .exposures = 2,
                          .ground = true,
                          .mean = {1, 2, 3},
                          .normal = {4, 5},
                          .intensity = 6,
                          .mask = 7};
  const Voxel expected{.position = 31,
                       .hits = 24,
                       .exposures = 16,
                       .ground = true,
                       .mean = {1, 2, 3},
                       .normal = {4, 5},
                       .intensity = 6,
                       .mask = 7,
                       .first_seen = 100,
                       .last_seen = 100};
  const Block merged =
      Merged({kBlock, {{.position = 30, .hits = 8}, {.position = 32, .hits = 8}}}, SessionOf({seen}, 20));
  ASSERT_EQ(merged.voxels.size(), 3U);
  EXPECT_EQ(merged.voxels[1], expected);
}

TEST(Merge, WithoutAHitOnlyTheCountsChange) {
  Voxel old{.hits = 800,
            .exposures = 8,
            .ground = true,
            .is_static = true,
            .mean = {10, 20, 30},
            .normal = EncodeNormal(Eigen::Vector3d::UnitZ()),
            .intensity = 50,
            .mask = 0xf0,
            .first_seen = 3,
            .last_seen = 4};
  Voxel merged = OnlyVoxel(old, {.exposures = 1}, 20);
  EXPECT_LT(merged.hits, old.hits);
  merged.hits = old.hits;
  merged.exposures = old.exposures;
  old.position = merged.position;
  EXPECT_EQ(merged, old);
}

TEST(Merge, FieldsAreWeightedByTheEvidenceBehindThem) {
  const MergeParameters half{.gamma = 4, .alpha_min = 0.5, .alpha_max = 0.5};
  const Voxel old{.hits = 48,  // 6 scans, w = 3
                  .ground = true,
                  .mean = {10, 20, 30},
                  .normal = EncodeNormal(Eigen::Vector3d::UnitX()),
                  .intensity = 100,
                  .mask = 0x0f,
                  .first_seen = 7,
                  .last_seen = 8};
  const SessionVoxel session{
      .hits = 1, .mean = {50, 60, 70}, .normal = EncodeNormal(Eigen::Vector3d::UnitY()), .intensity = 20, .mask = 0xf0};
  const Voxel merged = OnlyVoxel(old, session, 20, half);
  EXPECT_EQ(merged.mean, (std::array<uint8_t, 3>{20, 30, 40}));  // (3 * 10 + 1 * 50) / 4, ...
  EXPECT_EQ(merged.intensity, 80);                               // (3 * 100 + 20) / 4
  const Eigen::Vector3d expected = Eigen::Vector3d(3, 1, 0).normalized();
  EXPECT_GT(DecodeNormal(merged.normal).dot(expected), std::cos(0.03));
  EXPECT_FALSE(merged.ground);
  EXPECT_EQ(merged.mask, 0xffU);  // H_S = 1 < w = 3: the union
  EXPECT_EQ(merged.first_seen, 7U);
  EXPECT_EQ(merged.last_seen, 100U);
  EXPECT_EQ(OnlyVoxel(old, {.hits = 3, .mask = 0xf0}, 20, half).mask, 0xf0U);  // H_S = w: the session's alone
}

TEST(Merge, NormalsThatCancelLeaveTheHeavierOne) {
  const MergeParameters half{.gamma = 4, .alpha_min = 0.5, .alpha_max = 0.5};
  const auto up = EncodeNormal(Eigen::Vector3d::UnitZ()), down = EncodeNormal(-Eigen::Vector3d::UnitZ());
  EXPECT_EQ(OnlyVoxel({.hits = 170, .normal = up}, {.hits = 10, .normal = down}, 20, half).normal, up);
  EXPECT_EQ(OnlyVoxel({.hits = 150, .normal = up}, {.hits = 10, .normal = down}, 20, half).normal, down);
  EXPECT_EQ(OnlyVoxel({.hits = 150}, {.hits = 10, .normal = down}, 20, half).normal, down);
  EXPECT_EQ(OnlyVoxel({.hits = 150, .normal = up}, {.hits = 10}, 20, half).normal, up);
}

TEST(Merge, AnOverflowHalvesBothCountsAndKeepsR) {
  const Block made =
      Merged({.key = kBlock}, SessionOf({{.key = VoxelKeyOf(kBlock, 1), .hits = 9000, .exposures = 3000}}, 12000));
  ASSERT_EQ(made.voxels.size(), 1U);
  EXPECT_EQ(made.voxels[0].hits, 36000);  // 72,000 eighths do not fit in 16 bits
  EXPECT_EQ(made.voxels[0].exposures, 12000);
  // 0.95 * 65,535 + 8 * 500 = 66,258.25 -> 33,129; 0.95 * 21,845 + 8 * 167 = 22,088.75 -> 11,044.
  const Voxel merged = OnlyVoxel({.hits = 65535, .exposures = 21845}, {.hits = 500, .exposures = 167}, 1e6);
  EXPECT_EQ(merged.hits, 33129);
  EXPECT_EQ(merged.exposures, 11044);
  EXPECT_NEAR(Stability(merged.hits, merged.exposures, 0), 0.75, 1e-4);
}

}  // namespace
}  // namespace mapkeep
