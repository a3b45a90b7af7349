#include "server/pipeline/session_feed.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace mapkeep {
namespace {

TEST(SessionFeed, WatchersHearOfTheirSessionOnly) {
  SessionFeed feed;
  int heard = 0;
  const auto watcher = feed.Watch({"a", "1"}, [&] { ++heard; });
  feed.Changed({"a", "2"});
  feed.Changed({"b", "1"});
  EXPECT_EQ(heard, 0);
  feed.Changed({"a", "1"});
  EXPECT_EQ(heard, 1);
  feed.Unwatch(watcher);
  feed.Changed({"a", "1"});
  EXPECT_EQ(heard, 1);
}

TEST(SessionFeed, WhoWatchesAMapHearsOfEachOfItsSessions) {
  SessionFeed feed;
  std::vector<std::string> heard;
  const auto watcher = feed.WatchMap("a", [&](const std::string& session) { heard.push_back(session); });
  feed.Changed({"a", "1"});
  feed.Changed({"b", "2"});
  feed.SetProgress({"a", "3"}, {"align", 0.5});
  EXPECT_EQ(heard, (std::vector<std::string>{"1", "3"}));
  feed.Close();
  EXPECT_EQ(heard.back(), "");
  feed.Unwatch(watcher);
  feed.Changed({"a", "4"});
  EXPECT_EQ(heard.size(), 3U);
}

TEST(SessionFeed, ProgressIsToldInHundredths) {
  SessionFeed feed;
  int heard = 0;
  feed.Watch({"a", "1"}, [&] { ++heard; });
  feed.SetProgress({"a", "1"}, {"align", 0.001});
  EXPECT_EQ(heard, 1);
  feed.SetProgress({"a", "1"}, {"align", 0.002});
  EXPECT_EQ(heard, 1);
  feed.SetProgress({"a", "1"}, {"align", 0.011});
  EXPECT_EQ(heard, 2);
  feed.SetProgress({"a", "1"}, {"clean", 0.011});
  EXPECT_EQ(heard, 3);
  EXPECT_EQ(feed.Progress({"a", "1"})->stage, "clean");
  feed.ClearProgress({"a", "1"});
  EXPECT_FALSE(feed.Progress({"a", "1"}).has_value());
}

TEST(SessionFeed, EveryWatcherHearsOfTheEnd) {
  SessionFeed feed;
  int heard = 0;
  feed.Watch({"a", "1"}, [&] { ++heard; });
  feed.Watch({"b", "2"}, [&] { ++heard; });
  feed.Close();
  EXPECT_EQ(heard, 2);
  EXPECT_TRUE(feed.closed());
}

}  // namespace
}  // namespace mapkeep
