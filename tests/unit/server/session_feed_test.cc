#include "server/pipeline/session_feed.h"

#include <gtest/gtest.h>

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
