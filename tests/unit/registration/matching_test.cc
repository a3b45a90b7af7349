#include "core/registration/matching.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace mapkeep {
namespace {

using ::testing::ElementsAre;

// Descriptors on a line: distances are differences of one byte.
std::vector<Descriptor> On(std::initializer_list<int> values) {
  std::vector<Descriptor> descriptors;
  for (const int value : values) {
    descriptors.push_back(Descriptor{});
    descriptors.back()[0] = static_cast<uint8_t>(value);
  }
  return descriptors;
}

std::vector<std::pair<uint32_t, uint32_t>> MatchesOf(const std::vector<Descriptor>& source,
                                                     const std::vector<Descriptor>& target,
                                                     const MatchingParameters& parameters = {.probes = 64}) {
  const DescriptorIndex index(target, std::make_shared<const Codebook>(LearnCodebook(target)));
  std::vector<std::pair<uint32_t, uint32_t>> pairs;
  for (const Match& match : MatchDescriptors(source, target, index, parameters)) {
    pairs.emplace_back(match.source, match.target);
  }
  return pairs;
}

TEST(Matching, MostDistinctiveMatchesComeFirst) {
  // Ratios: 1 / 49^2 for 149, 3^2 / 97^2 for 3, 2^2 / 48^2 for 102.
  EXPECT_THAT(MatchesOf(On({102, 149, 3}), On({0, 100, 150})),
              ElementsAre(std::pair(1U, 2U), std::pair(2U, 0U), std::pair(0U, 1U)));
}

TEST(Matching, OfTwoSourcesThatWantOneTargetOnlyTheNearerGetsIt) {
  EXPECT_THAT(MatchesOf(On({103, 101}), On({0, 100, 200})), ElementsAre(std::pair(1U, 1U)));
}

TEST(Matching, AnAmbiguousSourceHasNoMatch) {
  // 80^2 / 81^2 = 0.975 is above 0.97.
  EXPECT_THAT(MatchesOf(On({100}), On({20, 181})), ElementsAre());
  // 80^2 / 82^2 = 0.952 is below.
  EXPECT_THAT(MatchesOf(On({100}), On({20, 182})), ElementsAre(std::pair(0U, 0U)));
}

TEST(Matching, EqualTargetsCannotBeToldApart) { EXPECT_THAT(MatchesOf(On({50, 50}), On({50, 50})), ElementsAre()); }

TEST(Matching, KeepsNoMoreThanAskedFor) {
  EXPECT_THAT(MatchesOf(On({102, 149, 3}), On({0, 100, 150}), {.max_matches = 1, .probes = 64}),
              ElementsAre(std::pair(1U, 2U)));
}

TEST(Matching, LimitedQueriesAreSpreadOverTheSource) {
  EXPECT_THAT(MatchesOf(On({0, 60, 120, 180}), On({0, 60, 120, 180}), {.max_queries = 2, .probes = 64}),
              ElementsAre(std::pair(0U, 0U), std::pair(2U, 2U)));
}

TEST(Matching, NothingMatchesNothing) {
  EXPECT_THAT(MatchesOf({}, On({1, 2})), ElementsAre());
  EXPECT_THAT(MatchesOf(On({1, 2}), {}), ElementsAre());
}

}  // namespace
}  // namespace mapkeep
