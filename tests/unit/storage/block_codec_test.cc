#include "storage/block_codec.h"

#include <gtest/gtest.h>

#include "tests/unit/storage/random_blocks.h"
#include "tests/unit/storage/status_matchers.h"

namespace mapkeep {
namespace {

constexpr BlockKey kKey{0x123456789abc};

TEST(BlockCodec, ABlockComesBackAsItWas) {
  std::mt19937_64 random(1);
  for (const size_t count : {1, 2, 3, 500, 32768}) {
    const Block block = RandomBlock(kKey, count, random);
    const absl::StatusOr<std::string> value = EncodeBlock(block);
    ASSERT_DONE(value);
    const absl::StatusOr<Block> read = DecodeBlock(*value, kKey);
    ASSERT_DONE(read);
    EXPECT_EQ(*read, block) << count;
  }
}

TEST(BlockCodec, TheSameBlockGivesTheSameBytes) {
  std::mt19937_64 random(2);
  const Block block = RandomBlock(kKey, 700, random);
  EXPECT_EQ(*EncodeBlock(block), *EncodeBlock(block));
}

TEST(BlockCodec, RefusesWhatIsNotABlock) {
  EXPECT_CODE(EncodeBlock({kKey, {}}), kInvalidArgument);
  EXPECT_CODE(EncodeBlock({kKey, {{.position = 2}, {.position = 1}}}), kInvalidArgument);
  EXPECT_CODE(EncodeBlock({kKey, {{.position = 2}, {.position = 2}}}), kInvalidArgument);
  EXPECT_CODE(EncodeBlock({kKey, {{.position = 32768}}}), kInvalidArgument);
}

TEST(BlockCodec, EveryFlippedBitIsNoticed) {
  std::mt19937_64 random(3);
  const std::string value = *EncodeBlock(RandomBlock(kKey, 40, random));
  for (size_t at = 0; at < value.size(); ++at) {
    for (int bit = 0; bit < 8; ++bit) {
      std::string damaged = value;
      damaged[at] = static_cast<char>(damaged[at] ^ (1 << bit));
      ASSERT_CODE(DecodeBlock(damaged, kKey), kDataLoss) << "byte " << at << " bit " << bit;
    }
  }
}

TEST(BlockCodec, EveryTruncationAndExtensionIsNoticed) {
  std::mt19937_64 random(4);
  const std::string value = *EncodeBlock(RandomBlock(kKey, 40, random));
  for (size_t length = 0; length < value.size(); ++length) {
    ASSERT_CODE(DecodeBlock(std::string_view(value).substr(0, length), kKey), kDataLoss) << length;
  }
  EXPECT_CODE(DecodeBlock(value + '\0', kKey), kDataLoss);
}

TEST(BlockCodec, AnotherBlocksValueIsNoticedAndTheBlockNamed) {
  std::mt19937_64 random(5);
  const std::string value = *EncodeBlock(RandomBlock(BlockKeyOf(VoxelIndex{1, 2, 3}), 40, random));
  const absl::Status status = DecodeBlock(value, BlockKeyOf(VoxelIndex{1, -2, 3})).status();
  EXPECT_CODE(status, kDataLoss);
  EXPECT_NE(std::string(status.message()).find("(1, -2, 3)"), std::string::npos) << status;
}

TEST(BlockCodec, BytesThatNeverWereABlockAreRefused) {
  std::mt19937_64 random(6);
  for (int i = 0; i < 2000; ++i) {
    std::string bytes(random() % 200, '\0');
    for (char& byte : bytes) byte = static_cast<char>(random());
    ASSERT_CODE(DecodeBlock(bytes, kKey), kDataLoss);
  }
}

}  // namespace
}  // namespace mapkeep
