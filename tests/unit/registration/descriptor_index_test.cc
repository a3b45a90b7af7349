#include "core/registration/descriptor_index.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>

namespace mapkeep {
namespace {

std::vector<Descriptor> RandomDescriptors(size_t count, int seed) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<int> byte(0, 255);
  std::vector<Descriptor> descriptors(count);
  for (Descriptor& descriptor : descriptors) {
    for (uint8_t& value : descriptor) value = static_cast<uint8_t>(byte(random));
  }
  return descriptors;
}

DescriptorIndex IndexOf(const std::vector<Descriptor>& descriptors) {
  return {descriptors, std::make_shared<const Codebook>(LearnCodebook(descriptors))};
}

TEST(DescriptorIndex, DistancesAreExact) {
  Descriptor a{};
  Descriptor b{};
  a[0] = 3;
  b[32] = 4;
  EXPECT_EQ(SquaredDistance(RowOf(a), RowOf(b)), 25);
  a.fill(255);
  b.fill(0);
  EXPECT_EQ(SquaredDistance(RowOf(a), RowOf(b)), 33 * 255 * 255);
}

TEST(DescriptorIndex, FindsTheNearestTwoAsAnExhaustiveSearchDoes) {
  const auto descriptors = RandomDescriptors(700, 1);
  const DescriptorIndex index = IndexOf(descriptors);
  for (const Descriptor& query : RandomDescriptors(50, 2)) {
    int32_t best = std::numeric_limits<int32_t>::max();
    int32_t second = best;
    size_t at = 0;
    for (size_t i = 0; i < descriptors.size(); ++i) {
      const int32_t squared = SquaredDistance(RowOf(query), RowOf(descriptors[i]));
      if (squared < best) at = i;
      second = std::min(second, std::max(best, squared));
      best = std::min(best, squared);
    }
    const auto nearest = index.Find(RowOf(query), 64);
    ASSERT_TRUE(nearest);
    EXPECT_EQ(nearest->index, at);
    EXPECT_EQ(nearest->squared, best);
    EXPECT_EQ(nearest->second_squared, second);
  }
}

TEST(DescriptorIndex, FindsADescriptorThatItHoldsWithOneProbe) {
  const auto descriptors = RandomDescriptors(5000, 3);
  const DescriptorIndex index = IndexOf(descriptors);
  for (uint32_t i = 0; i < descriptors.size(); i += 97) {
    const auto nearest = index.Find(RowOf(descriptors[i]), 1);
    ASSERT_TRUE(nearest);
    EXPECT_EQ(nearest->index, i);
    EXPECT_EQ(nearest->squared, 0);
  }
}

TEST(DescriptorIndex, OfEqualDescriptorsTheFirstIsNearestAndTheNextSecond) {
  const std::vector<Descriptor> descriptors(20, RandomDescriptors(1, 4)[0]);
  const auto nearest = IndexOf(descriptors).Find(RowOf(descriptors[0]), 64);
  ASSERT_TRUE(nearest);
  EXPECT_EQ(nearest->index, 0);
  EXPECT_EQ(nearest->squared, 0);
  EXPECT_EQ(nearest->second_squared, 0);
}

TEST(DescriptorIndex, OneDescriptorHasNoSecondAndNoneHasNoNearest) {
  const auto one = RandomDescriptors(1, 5);
  const auto nearest = IndexOf(one).Find(RowOf(one[0]), 3);
  ASSERT_TRUE(nearest);
  EXPECT_EQ(nearest->second_squared, std::numeric_limits<int32_t>::max());
  EXPECT_FALSE(IndexOf({}).Find(RowOf(one[0]), 3));
}

}  // namespace
}  // namespace mapkeep
