// What every engine promises.

#include "tests/unit/storage/engine_conformance.h"

#include <gmock/gmock.h>

#include <atomic>
#include <thread>

namespace mapkeep {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;

TEST_P(EngineTest, ARowReadsAsItWasWrittenOrNotAtAll) {
  const std::string bytes("\0\xff\n", 3);
  EXPECT_DONE(Put("p", bytes, bytes + bytes));
  EXPECT_DONE(Put("p", "empty", ""));
  EXPECT_EQ(Find(bytes), bytes + bytes);
  EXPECT_EQ(Find("empty"), "");
  EXPECT_EQ(Find("other"), std::nullopt);
}

TEST_P(EngineTest, RowsComeInTheOrderOfTheirBytesWithinTheRange) {
  for (const char* key : {"b", "\xff", "a", "ab", "c"}) EXPECT_DONE(Put("p", key, "1"));
  EXPECT_THAT(RowsOf("p"),
              ElementsAre(Pair("a", "1"), Pair("ab", "1"), Pair("b", "1"), Pair("c", "1"), Pair("\xff", "1")));
  EXPECT_THAT(RowsOf("p", "ab", "c"), ElementsAre(Pair("ab", "1"), Pair("b", "1")));
  EXPECT_THAT(RowsOf("p", "d", "e"), IsEmpty());
}

TEST_P(EngineTest, AScanEndsWhenItIsToldTo) {
  for (const char* key : {"a", "b", "c"}) EXPECT_DONE(Put("p", key, ""));
  int seen = 0;
  EXPECT_DONE(engine_->Scan("p", "", "", [&seen](std::string_view, std::string_view) { return ++seen < 2; }));
  EXPECT_EQ(seen, 2);
}

TEST_P(EngineTest, NoPartitionSeesRowsOfAnotherWhateverTheNames) {
  // Names and keys that would collide if one were just put before the other.
  const std::vector<std::string> names = {
      "a", "aa", std::string("a\0a", 3), std::string(1, '\xff'), std::string(300, '\xff'), "ab"};
  for (const std::string& name : names) EXPECT_DONE(Put(name, "a", name));
  for (const std::string& name : names) EXPECT_THAT(RowsOf(name), ElementsAre(Pair("a", name)));
  EXPECT_THAT(RowsOf("b"), IsEmpty());
}

TEST_P(EngineTest, RowsAndValuesOfTheSameNameAreDifferentThings) {
  EXPECT_DONE(Put("p", "key", "row"));
  const std::vector<ImmutableValue> values = {{"key", "value"}};
  EXPECT_DONE(engine_->PutValues("p", values));
  EXPECT_EQ(Find("key"), "row");
  EXPECT_EQ(*engine_->GetValue("p", "key"), "value");
}

TEST_P(EngineTest, AWriteDeletesAndReplacesTogether) {
  EXPECT_DONE(Put("p", "a", "1"));
  EXPECT_DONE(Put("p", "b", "1"));
  const std::vector<Mutation> mutations = {{"a", std::nullopt}, {"b", "2"}, {"never there", std::nullopt}};
  EXPECT_DONE(engine_->Write("p", mutations, Durability::kDurable));
  EXPECT_THAT(RowsOf("p"), ElementsAre(Pair("b", "2")));
}

TEST_P(EngineTest, CompareAndSetAppliesAllOrNothing) {
  EXPECT_DONE(Swap({{"a", std::nullopt}}, {{"a", "1"}, {"b", "1"}}));
  EXPECT_CODE(Swap({{"a", std::nullopt}}, {{"a", "2"}}), kAborted);
  EXPECT_CODE(Swap({{"a", "1"}, {"b", "2"}}, {{"a", "2"}, {"b", "3"}}), kAborted);
  EXPECT_CODE(Swap({{"a", "1"}, {"c", ""}}, {{"a", "2"}}), kAborted) << "absent is not empty";
  EXPECT_EQ(Find("a"), "1");
  EXPECT_EQ(Find("b"), "1");
  EXPECT_DONE(Swap({{"a", "1"}, {"b", "1"}, {"c", std::nullopt}}, {{"a", std::nullopt}, {"c", ""}}));
  EXPECT_EQ(Find("a"), std::nullopt);
  EXPECT_EQ(Find("c"), "");
  EXPECT_CODE(Swap({{"c", std::nullopt}}, {{"c", "1"}}), kAborted) << "empty is not absent";
}

TEST_P(EngineTest, CompareAndSetNamesTheRowThatDiffers) {
  EXPECT_DONE(Put("p", "head", "1"));
  const absl::Status refused = Swap({{"head", "0"}}, {{"head", "2"}});
  EXPECT_THAT(std::string(refused.message()), testing::HasSubstr("head"));
}

TEST_P(EngineTest, EveryIncrementByCompareAndSetCounts) {
  constexpr int kThreads = 4, kIncrements = 25;
  EXPECT_DONE(Put("p", "count", "0"));
  std::atomic<int> failures = 0;
  std::vector<std::thread> threads;
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([&] {
      for (int done = 0; done < kIncrements;) {
        const auto found = engine_->Get("p", "count");
        if (!found.ok()) {
          ++failures;
          return;
        }
        const absl::Status status = Swap({{"count", **found}}, {{"count", std::to_string(std::stoi(**found) + 1)}});
        if (status.ok()) {
          ++done;
        } else if (!absl::IsAborted(status)) {
          ++failures;
          return;
        }
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(failures, 0);
  EXPECT_EQ(Find("count"), std::to_string(kThreads * kIncrements));
}

TEST_P(EngineTest, ValuesAreReadByGroupAndKeyUntilTheyAreDeleted) {
  const std::string large(100000, 'x');
  const std::vector<ImmutableValue> values = {{"b", large}, {"a", ""}, {"c", "3"}};
  EXPECT_DONE(engine_->PutValues("g", values));
  EXPECT_DONE(engine_->PutValues("g", values)) << "the same again does no harm";
  EXPECT_EQ(*engine_->GetValue("g", "b"), large);
  EXPECT_EQ(*engine_->GetValue("g", "a"), "");
  EXPECT_CODE(engine_->GetValue("g", "d"), kNotFound);
  EXPECT_CODE(engine_->GetValue("h", "a"), kNotFound);
  EXPECT_THAT(ValueKeysOf("g"), ElementsAre("a", "b", "c"));
  EXPECT_THAT(ValueKeysOf("g", "b", "c"), ElementsAre("b"));
  const std::vector<std::string> keys = {"b", "never there"};
  EXPECT_DONE(engine_->DeleteValues("g", keys));
  EXPECT_CODE(engine_->GetValue("g", "b"), kNotFound);
  EXPECT_THAT(ValueKeysOf("g"), ElementsAre("a", "c"));
}

TEST_P(EngineTest, ValuesReadTogetherEachHaveTheirOwnAnswer) {
  const std::string large(3000000, 'x');
  const std::vector<ImmutableValue> first = {{"a", ""}, {"b", large}, {"c", "3"}},
                                    second = {{"d", std::string(5000, 'd')}}, apart = {{"e", std::string(100, 'e')}};
  ASSERT_DONE(engine_->PutValues("g", first));
  ASSERT_DONE(engine_->PutValues("g", second));
  ASSERT_DONE(engine_->PutLargeValues("g", apart));
  for (int round = 0; round < 2; ++round) {
    const std::vector<std::string> keys = {"d", "b", "nothing", "a", "e", "c", "b"};
    const auto values = engine_->GetValues("g", keys);
    ASSERT_EQ(values.size(), keys.size());
    EXPECT_EQ(*values[0], second[0].value);
    EXPECT_EQ(*values[1], large);
    EXPECT_CODE(values[2], kNotFound);
    EXPECT_EQ(*values[3], "");
    EXPECT_EQ(*values[4], apart[0].value);
    EXPECT_EQ(*values[5], "3");
    EXPECT_EQ(*values[6], large) << "asked for twice";
    engine_.Reopen();
  }
  EXPECT_CODE(engine_->GetValues("h", std::vector<std::string>{"a"}).front(), kNotFound);
  EXPECT_THAT(engine_->GetValues("g", {}), IsEmpty());
}

TEST_P(EngineTest, ManyGroupsAreWrittenTogether) {
  std::vector<ValueGroup> groups;
  for (int g = 0; g < 20; ++g) {
    groups.push_back({std::to_string(g), {}});
    for (int v = 0; v < 5; ++v)
      groups.back().values.push_back({std::to_string(v), std::string(1000 * v, 'a' + g % 26)});
  }
  EXPECT_DONE(engine_->PutGroups(groups));
  for (const ValueGroup& group : groups) {
    for (const ImmutableValue& value : group.values) EXPECT_EQ(*engine_->GetValue(group.group, value.key), value.value);
  }
}

TEST_P(EngineTest, ValuesWrittenAgainWithNewOnesBesideThemAreAllThere) {
  const std::vector<ImmutableValue> first = {{"a", "1"}, {"b", "2"}};
  const std::vector<ImmutableValue> more = {{"a", "1"}, {"c", "3"}};
  EXPECT_DONE(engine_->PutValues("g", first));
  EXPECT_DONE(engine_->PutValues("g", more));
  EXPECT_THAT(ValueKeysOf("g"), ElementsAre("a", "b", "c"));
  const std::vector<std::string> a = {"a"}, rest = {"b", "c"};
  EXPECT_DONE(engine_->DeleteValues("g", a));
  EXPECT_EQ(*engine_->GetValue("g", "b"), "2");
  EXPECT_EQ(*engine_->GetValue("g", "c"), "3");
  EXPECT_DONE(engine_->DeleteValues("g", rest));
  EXPECT_DONE(engine_->DeleteValues("g", rest));
  EXPECT_THAT(ValueKeysOf("g"), IsEmpty());
}

TEST_P(EngineTest, LargeValuesAreReadListedAndDeletedLikeOthersWhereverTheyLie) {
  const auto value = [](char name, size_t bytes) {
    return ImmutableValue{std::string(1, name), std::string(bytes, name)};
  };
  const std::vector<ImmutableValue> small = {value('a', 10)}, large = {value('c', 3 << 20), value('b', 100)},
                                    again = {value('b', 100), value('d', 1 << 20)};
  ASSERT_DONE(engine_->PutValues("g", small));
  ASSERT_DONE(engine_->PutLargeValues("g", large));
  ASSERT_DONE(engine_->PutLargeValues("g", again)) << "partly the same again does no harm";
  ASSERT_DONE(engine_->PutLargeValues("other", large));
  engine_.Reopen();
  for (const auto& values : {small, large, again}) {
    for (const ImmutableValue& one : values) EXPECT_EQ(*engine_->GetValue("g", one.key), one.value);
  }
  const auto names = [&](std::string_view group) {
    std::string all;
    EXPECT_DONE(engine_->ScanValueKeys(group, "", "", [&](std::string_view key) {
      all += key;
      return true;
    }));
    return all;
  };
  EXPECT_EQ(names("g"), "abcd");
  EXPECT_CODE(engine_->GetValue("g", "e"), kNotFound);

  // Not what lies between those that go, nor what lies beside them in a file.
  ASSERT_DONE(engine_->DeleteValues("g", std::vector<std::string>{"a", "d"}));
  EXPECT_EQ(names("g"), "bc");
  EXPECT_EQ(*engine_->GetValue("g", "b"), again[0].value);
  EXPECT_EQ(*engine_->GetValue("g", "c"), large[0].value);
  EXPECT_CODE(engine_->GetValue("g", "d"), kNotFound);
  ASSERT_DONE(engine_->DeleteValues("g", std::vector<std::string>{"b", "c"}));
  EXPECT_EQ(names("g"), "");
  engine_.Reopen();
  for (const char* key : {"a", "b", "c", "d"}) EXPECT_CODE(engine_->GetValue("g", key), kNotFound) << key;
  EXPECT_EQ(*engine_->GetValue("other", "c"), large[0].value);
  EXPECT_EQ(*engine_->GetValue("other", "b"), large[1].value);
  ASSERT_DONE(engine_->PutLargeValues("g", large)) << "a name that was deleted may come back with what it had";
  EXPECT_EQ(*engine_->GetValue("g", "c"), large[0].value);
}

TEST_P(EngineTest, AScanReadsThousandsOfRows) {
  std::vector<Mutation> rows;
  for (int i = 10000; i < 13500; ++i) rows.push_back({std::to_string(i), "x"});
  EXPECT_DONE(engine_->Write("p", rows, Durability::kBuffered));
  EXPECT_EQ(RowsOf("p").size(), 3500U);
  EXPECT_EQ(RowsOf("p", "10001", "13400").size(), 3399U);
}

TEST_P(EngineTest, WhatWasWrittenIsThereWhenItIsOpenedAgain) {
  EXPECT_DONE(Put("p", "a", "1"));
  const std::vector<ImmutableValue> values = {{"v", std::string(5000, 'v')}};
  EXPECT_DONE(engine_->PutValues("g", values));
  EXPECT_DONE(Swap({{"a", "1"}}, {{"a", "2"}}));
  EXPECT_DONE(engine_->Sync());
  engine_.Reopen();
  EXPECT_EQ(Find("a"), "2");
  EXPECT_EQ(*engine_->GetValue("g", "v"), std::string(5000, 'v'));
}

TEST_P(EngineTest, ACheckpointIsTheStateOfItsMoment) {
  if (!GetParam().has_checkpoints) {
    EXPECT_CODE(engine_->Checkpoint(engine_.root() + "/copy"), kUnimplemented);
    return;
  }
  EXPECT_DONE(Put("p", "a", "1"));
  const std::vector<ImmutableValue> large = {{"l", std::string(4 << 20, 'l')}};
  EXPECT_DONE(engine_->PutLargeValues("g", large));
  const std::string copy = engine_.root() + "/copy";
  ASSERT_DONE(engine_->Checkpoint(copy));
  EXPECT_DONE(Put("p", "a", "2"));
  EXPECT_DONE(engine_->DeleteValues("g", std::vector<std::string>{"l"}));
  const auto opened = GetParam().open(copy);
  ASSERT_DONE(opened);
  EXPECT_EQ(*(*opened)->GetValue("g", "l"), large[0].value);
  EXPECT_EQ(**(*opened)->Get("p", "a"), "1");
  EXPECT_FALSE(engine_->Checkpoint(copy).ok()) << "a checkpoint never goes over an older one";
}

TEST_P(EngineTest, APartitionHasAName) {
  EXPECT_CODE(Put("", "a", "1"), kInvalidArgument);
  EXPECT_CODE(Put(std::string(70000, 'x'), "a", "1"), kInvalidArgument);
}

}  // namespace
}  // namespace mapkeep
