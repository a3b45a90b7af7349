// Exactly once: commits that race, time out, or are applied after they timed out.

#include <gmock/gmock.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <random>
#include <thread>

#include "storage/collector.h"
#include "tests/unit/storage/counting_map.h"
#include "tests/unit/storage/test_engine.h"
#include "tests/unit/storage/unanswering_engine.h"

namespace mapkeep {
namespace {

std::set<int> Upto(int count) {
  std::set<int> sessions;
  for (int i = 0; i < count; ++i) sessions.insert(i);
  return sessions;
}

/// Long past every lease, one epoch kept.
GarbageOptions ThoroughCollection() {
  return {.keep_epochs = 1, .now = [] { return SystemSeconds() + 1e6; }};
}

TEST(CommitRace, ThreadsOnOneMapAllCommitOnceAndNothingIsLost) {
  constexpr int kThreads = 4, kSessions = 40;
  TestEngine engine;
  uint64_t incarnation = 0;
  {
    // Two stores, as two daemons on one engine.
    const auto a = OpenMapStore(*engine, {});
    const auto b = OpenMapStore(*engine, {});
    incarnation = a->Create({.name = "m"})->incarnation;
    std::atomic<int> failures = 0;
    std::vector<std::thread> threads;
    for (int t = 0; t < kThreads; ++t) {
      threads.emplace_back([&, t] {
        MapStore& maps = t % 2 == 0 ? *a : *b;
        // Every session is tried by two threads.
        for (int session = t / 2; session < kSessions; session += kThreads / 2) {
          if (!maps.Commit("m", CountingRequest(session)).ok()) ++failures;
        }
      });
    }
    for (std::thread& thread : threads) thread.join();
    EXPECT_EQ(failures, 0);
    ExpectCounted(*a, Upto(kSessions));
    CheckMap(*engine, incarnation);
  }
  ASSERT_DONE(CollectGarbage(*engine, ThoroughCollection()));
  EXPECT_EQ(CheckMap(*engine, incarnation), 0U) << "values that nothing reaches";
  ExpectCounted(*OpenMapStore(*engine, {}), Upto(kSessions));
}

/// One operation of a commit, counted from 0, has this fate.
class OneUnanswered : public testing::TestWithParam<std::tuple<Fate, int>> {};

TEST_P(OneUnanswered, TheSessionIsAppliedOnceAndNothingIsLeftBehind) {
  const auto [fate, at] = GetParam();
  TestEngine engine;
  int operation = -1000;
  UnansweringEngine unanswering(*engine,
                                [&, fate = fate, at = at] { return operation++ == at ? fate : Fate::kAnswered; });
  uint64_t incarnation = 0;
  {
    const auto maps = OpenMapStore(unanswering, {});
    incarnation = maps->Create({.name = "m"})->incarnation;
    const auto pin = *maps->Open("m");  // so that what follows begins with the intent
    ASSERT_DONE(maps->Commit("m", CountingRequest(0)));
    operation = 0;
    ASSERT_DONE(maps->Commit("m", CountingRequest(1)));
    EXPECT_GE(operation, 2);
    ExpectCounted(*maps, Upto(2));
    unanswering.ApplyLate();
    ExpectCounted(*maps, Upto(2));
    ASSERT_DONE(maps->Commit("m", CountingRequest(1)));
    ASSERT_DONE(maps->Commit("m", CountingRequest(2)));
    ExpectCounted(*maps, Upto(3));
  }
  ASSERT_DONE(CollectGarbage(unanswering, ThoroughCollection()));
  EXPECT_EQ(CheckMap(*engine, incarnation), 0U);
  ExpectCounted(*OpenMapStore(*engine, {}), Upto(3));
}

INSTANTIATE_TEST_SUITE_P(Operations, OneUnanswered,
                         testing::Combine(testing::Values(Fate::kApplied, Fate::kLost, Fate::kLate),
                                          testing::Values(0, 1)));

TEST(CommitRace, AnyOperationMayTimeOutAndArriveAtAnyTime) {
  constexpr int kThreads = 2, kSessions = 60;
  TestEngine engine;
  std::mt19937_64 random(1);
  UnansweringEngine unanswering(*engine, [&random] {
    constexpr Fate kFates[] = {Fate::kApplied, Fate::kLost, Fate::kLate};
    return random() % 4 == 0 ? kFates[random() % 3] : Fate::kAnswered;
  });
  uint64_t incarnation = 0;
  {
    const auto setup = OpenMapStore(*engine, {});
    incarnation = setup->Create({.name = "m"})->incarnation;
    const auto maps = OpenMapStore(unanswering, {});
    std::atomic<int> unknown = 0;
    std::vector<std::thread> threads;
    for (int t = 0; t < kThreads; ++t) {
      threads.emplace_back([&, t] {
        for (int session = t; session < kSessions; session += kThreads) {
          const auto record = maps->Commit("m", CountingRequest(session));
          unknown += record.ok() ? 0 : 1;
          if (session % 5 == t) unanswering.ApplyLate();
        }
      });
    }
    for (std::thread& thread : threads) thread.join();
    unanswering.ApplyLate();
    CheckMap(*engine, incarnation);
    // Whoever got no answer asks again.
    for (int session = 0; session < kSessions; ++session) {
      ASSERT_DONE(setup->Commit("m", CountingRequest(session)));
    }
    ExpectCounted(*setup, Upto(kSessions));
  }
  ASSERT_DONE(CollectGarbage(*engine, ThoroughCollection()));
  EXPECT_EQ(CheckMap(*engine, incarnation), 0U);
  ExpectCounted(*OpenMapStore(*engine, {}), Upto(kSessions));
}

TEST(CommitRace, OperationsThatAreAppliedSecondsAfterTheyTimedOutDoubleNothing) {
  const bool is_long = std::getenv("MAPKEEP_LONG") != nullptr;
  const auto delay = std::chrono::milliseconds(is_long ? 5000 : 40);
  const int sessions = is_long ? 4000 : 60;  // long enough for what is late to arrive amid the flow
  constexpr int kThreads = 2;
  TestEngine engine;
  std::mt19937_64 random(2);
  std::atomic<int> late = 0;
  uint64_t incarnation = 0;
  {
    UnansweringEngine delaying(
        *engine,
        [&] {
          const bool is_late = random() % 8 == 0;
          late += is_late ? 1 : 0;
          return is_late ? Fate::kLate : Fate::kAnswered;
        },
        delay);
    const auto setup = OpenMapStore(*engine, {});
    incarnation = setup->Create({.name = "m"})->incarnation;
    const auto maps = OpenMapStore(delaying, {});
    std::vector<std::thread> threads;
    for (int t = 0; t < kThreads; ++t) {
      threads.emplace_back([&, t] {
        for (int session = t; session < sessions; session += kThreads) {
          // Whoever got no answer asks again: the first answer counts.
          absl::Status status;
          for (int i = 0; i < 20; ++i) {
            status = maps->Commit("m", CountingRequest(session)).status();
            if (!absl::IsDeadlineExceeded(status)) break;
          }
          EXPECT_DONE(status) << session;
        }
      });
    }
    for (std::thread& thread : threads) thread.join();
    EXPECT_GT(late, 0);
    ExpectCounted(*setup, Upto(sessions));
    delaying.ApplyLate();
    ExpectCounted(*setup, Upto(sessions));
    EXPECT_THAT(setup->Verify("m")->problems, testing::IsEmpty());
  }
  ASSERT_DONE(CollectGarbage(*engine, ThoroughCollection()));
  EXPECT_EQ(CheckMap(*engine, incarnation), 0U);
}

}  // namespace
}  // namespace mapkeep
