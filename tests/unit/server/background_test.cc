#include "server/background.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <thread>

namespace mapkeep {
namespace {

int NiceOfThisThread() { return getpriority(PRIO_PROCESS, static_cast<id_t>(gettid())); }

TEST(Background, OnlyTheThreadThatAsksGivesWay) {
  const int before = NiceOfThisThread();
  int there = 0;
  std::thread([&there] {
    GiveWay();
    there = NiceOfThisThread();
  }).join();
  EXPECT_GT(there, before);
  EXPECT_EQ(NiceOfThisThread(), before);
}

}  // namespace
}  // namespace mapkeep
