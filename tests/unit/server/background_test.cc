#include "server/background.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <fstream>
#include <optional>
#include <string>
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

// As /proc says it; nothing where the kernel knows no slices of one's own.
std::optional<double> SliceOfThisThread() {
  std::ifstream file("/proc/self/task/" + std::to_string(gettid()) + "/sched");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("se.slice")) return std::stod(line.substr(line.find(':') + 1));
  }
  return std::nullopt;
}

TEST(Background, WhoAnswersHasShorterSlicesThanWhoGivesWayAndHandsThemOn) {
  std::optional<double> answering, started, background;
  std::thread([&] {
    AnswerSoon();
    answering = SliceOfThisThread();
    std::thread([&] {
      started = SliceOfThisThread();
      GiveWay();
      background = SliceOfThisThread();
    }).join();
  }).join();
  if (!answering) GTEST_SKIP() << "this kernel shows no slices";
  EXPECT_EQ(answering, started);
  EXPECT_LE(*answering, *background);
}

}  // namespace
}  // namespace mapkeep
