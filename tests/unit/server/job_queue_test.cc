#include "server/pipeline/job_queue.h"

#include <gtest/gtest.h>

#include <thread>

namespace mapkeep {
namespace {

TEST(JobQueue, SessionsGoByTheirTurns) {
  JobQueue queue;
  queue.Push("a", "young", false, 20);
  queue.Push("b", "old", false, 10);
  EXPECT_EQ(queue.Take()->session, "old");
  EXPECT_EQ(queue.Take()->session, "young");
}

TEST(JobQueue, AJobThatIsPutOffComesAgainAndLetsOthersBeMeanwhile) {
  JobQueue queue;
  queue.Push("a", "1", false, 1);
  const auto first = queue.Take();
  EXPECT_EQ(first->session, "1");
  EXPECT_FALSE(first->resumed);
  queue.Push("a", "2", false, 2);
  queue.PutOff(first, std::chrono::milliseconds(50));
  queue.Push("a", "1", false, 1);  // it is known already
  const auto second = queue.Take();
  EXPECT_EQ(second->session, "2");
  queue.Done(*second);
  const auto again = queue.Take();
  EXPECT_EQ(again->session, "1");
  EXPECT_TRUE(again->resumed);
  queue.Done(*again);
  queue.Close(StopReason::kHandBack);
  EXPECT_EQ(queue.Take(), nullptr);
}

TEST(JobQueue, AJobOfADeletedMapIsNotPutOff) {
  JobQueue queue;
  queue.Push("a", "1", false, 1);
  const auto job = queue.Take();
  std::jthread stopper([&] { queue.StopMap("a", StopReason::kMapDeleted); });
  while (job->stop == StopReason::kNone) std::this_thread::yield();
  queue.PutOff(job, std::chrono::milliseconds(0));
  stopper.join();
  queue.Push("b", "2", false, 2);
  EXPECT_EQ(queue.Take()->session, "2");
}

TEST(JobQueue, AMapHasOneJobAtWork) {
  JobQueue queue;
  queue.Push("a", "1", false, 1);
  queue.Push("a", "2", false, 2);
  queue.Push("b", "3", false, 3);
  const auto first = queue.Take();
  EXPECT_EQ(first->session, "1");
  const auto other = queue.Take();
  EXPECT_EQ(other->session, "3");
  queue.Done(*first);
  EXPECT_EQ(queue.Take()->session, "2");
}

TEST(JobQueue, ASessionIsQueuedOnce) {
  JobQueue queue;
  queue.Push("a", "1", false, 1);
  queue.Push("a", "1", false, 1);
  const auto job = queue.Take();
  queue.Push("a", "1", false, 1);  // at work
  queue.Done(*job);
  queue.Push("b", "2", false, 2);
  EXPECT_EQ(queue.Take()->session, "2");
  queue.Push("a", "1", false, 1);  // over: it may come again
  EXPECT_EQ(queue.Take()->session, "1");
}

TEST(JobQueue, TakeWaitsForAJobAndEndsWithTheQueue) {
  JobQueue queue;
  std::shared_ptr<Job> first, second = std::make_shared<Job>("", "", false, 0);
  std::jthread worker([&] {
    first = queue.Take();
    second = queue.Take();
  });
  queue.Push("a", "1", false, 1);
  queue.Close(StopReason::kHandBack);
  worker.join();
  EXPECT_EQ(second, nullptr);
  queue.Push("a", "2", false, 2);
  EXPECT_EQ(queue.Take(), nullptr);
}

TEST(JobQueue, ClosingStopsWhatIsAtWork) {
  JobQueue queue;
  queue.Push("a", "1", false, 1);
  const auto job = queue.Take();
  EXPECT_EQ(job->stop, StopReason::kNone);
  queue.Close(StopReason::kHandBack);
  EXPECT_EQ(job->stop, StopReason::kHandBack);
}

TEST(JobQueue, StoppingAMapDropsWhatWaitsAndWaitsForWhatIsAtWork) {
  JobQueue queue;
  queue.Push("a", "1", false, 1);
  const auto job = queue.Take();
  queue.Push("a", "2", false, 2);
  bool was_done = false;
  std::jthread worker([&] {
    while (job->stop == StopReason::kNone) std::this_thread::yield();
    was_done = true;
    queue.Done(*job);
  });
  queue.StopMap("a", StopReason::kMapDeleted);
  EXPECT_TRUE(was_done);
  EXPECT_EQ(job->stop, StopReason::kMapDeleted);
  queue.Push("b", "3", false, 3);
  EXPECT_EQ(queue.Take()->session, "3");  // and not "2" of map a
}

}  // namespace
}  // namespace mapkeep
