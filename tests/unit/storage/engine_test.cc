// What every engine promises. A second engine is one more EngineKind in the instantiation at the end.

#include "storage/engine.h"

#include <gmock/gmock.h>

#include <atomic>
#include <thread>

#include "tests/unit/storage/status_matchers.h"
#include "tests/unit/storage/test_engine.h"

namespace mapkeep {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;

using Rows = std::vector<std::pair<std::string, std::string>>;

class EngineTest : public testing::TestWithParam<EngineKind> {
 protected:
  absl::Status Put(std::string_view partition, const std::string& key, const std::string& value,
                   Durability durability = Durability::kBuffered) {
    const std::vector<Mutation> row = {{key, value}};
    return engine_->Write(partition, row, durability);
  }

  Rows RowsOf(std::string_view partition, std::string_view begin = "", std::string_view end = "") {
    Rows rows;
    EXPECT_DONE(engine_->Scan(partition, begin, end, [&rows](std::string_view key, std::string_view value) {
      rows.emplace_back(key, value);
      return true;
    }));
    return rows;
  }

  std::vector<std::string> ValueKeysOf(std::string_view group, std::string_view begin = "", std::string_view end = "") {
    std::vector<std::string> keys;
    EXPECT_DONE(engine_->ScanValueKeys(group, begin, end, [&keys](std::string_view key) {
      keys.emplace_back(key);
      return true;
    }));
    return keys;
  }

  absl::Status Swap(const std::vector<Condition>& conditions, const std::vector<Mutation>& mutations) {
    return engine_->CompareAndSet("p", conditions, mutations);
  }

  std::optional<std::string> Find(const std::string& key) {
    const auto found = engine_->Get("p", key);
    EXPECT_DONE(found);
    return found.ok() ? *found : std::nullopt;
  }

  TestEngine engine_{GetParam()};
};

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
  EXPECT_DONE(Put("p", "a", "1"));
  const std::string copy = engine_.root() + "/copy";
  ASSERT_DONE(engine_->Checkpoint(copy));
  EXPECT_DONE(Put("p", "a", "2"));
  const auto opened = GetParam().open(copy);
  ASSERT_DONE(opened);
  EXPECT_EQ(**(*opened)->Get("p", "a"), "1");
  EXPECT_FALSE(engine_->Checkpoint(copy).ok()) << "a checkpoint never goes over an older one";
}

TEST_P(EngineTest, APartitionHasAName) {
  EXPECT_CODE(Put("", "a", "1"), kInvalidArgument);
  EXPECT_CODE(Put(std::string(70000, 'x'), "a", "1"), kInvalidArgument);
}

INSTANTIATE_TEST_SUITE_P(Engines, EngineTest, testing::Values(RocksDbKind()),
                         [](const auto& kind) { return kind.param.name; });

}  // namespace
}  // namespace mapkeep
