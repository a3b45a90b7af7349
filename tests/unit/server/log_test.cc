#include "server/log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <thread>

namespace mapkeep {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

template <typename Function>
std::string Logged(LogFormat format, const Function& function) {
  StartLogging(format);
  ::testing::internal::CaptureStderr();
  function();
  return ::testing::internal::GetCapturedStderr();
}

TEST(Log, EveryLineOfACallCarriesItsTags) {
  const std::string lines = Logged(LogFormat::kText, [] {
    const LogScope scope(LogTags{{"request", "r-1"}, {"map", "yard"}});
    LogInfo("done", {{"epoch", 3}});
  });
  EXPECT_THAT(lines, HasSubstr("info done epoch=3 request=r-1 map=yard"));
}

TEST(Log, AFieldOfItsOwnWinsOverATag) {
  const std::string lines = Logged(LogFormat::kJson, [] {
    const LogScope scope(LogTags{{"map", "yard"}});
    LogInfo("copied", {{"map", "depot"}});
  });
  EXPECT_THAT(lines, AllOf(HasSubstr(R"("map":"depot")"), Not(HasSubstr("yard"))));
}

TEST(Log, TagsEndWithTheirScopeAndStayInTheirThread) {
  const std::string lines = Logged(LogFormat::kText, [] {
    {
      const LogScope outer(LogTags{{"request", "outer"}});
      { const LogScope inner(LogTags{{"request", "inner"}}); }
      LogInfo("first");
      std::thread([] { LogInfo("second"); }).join();
    }
    LogInfo("third");
  });
  EXPECT_THAT(lines, AllOf(HasSubstr("first request=outer"), HasSubstr("second\n"), HasSubstr("third\n"),
                           Not(HasSubstr("inner"))));
}

}  // namespace
}  // namespace mapkeep
