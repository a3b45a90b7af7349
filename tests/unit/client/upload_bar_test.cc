#include "client/cli/upload_bar.h"

#include <gtest/gtest.h>

namespace mapkeep {
namespace {

TEST(UploadBar, ShowsShareRateAndRemainingTime) {
  UploadBar bar;
  EXPECT_EQ(bar.Line({0, 100, 0, false}, 0), "[>                       ] 0 %, 0 of 100 scans");
  EXPECT_EQ(bar.Line({25, 100, 50'000'000, false}, 5),
            "[======>                 ] 25 %, 25 of 100 scans, 10.0 MB/s, 0:15 left");
  EXPECT_EQ(bar.Line({100, 100, 200'000'000, false}, 20),
            "[========================] 100 %, 100 of 100 scans, 10.0 MB/s, 0:00 left");
}

TEST(UploadBar, TheRateIsThatOfTheLastSeconds) {
  UploadBar bar;
  bar.Line({0, 1000, 0, false}, 0);
  bar.Line({500, 1000, 500'000'000, false}, 10);
  bar.Line({500, 1000, 500'000'000, false}, 11);
  EXPECT_EQ(bar.Line({510, 1000, 510'000'000, false}, 21),
            "[============>           ] 51 %, 510 of 1000 scans, 1.0 MB/s, 8:10 left");
}

TEST(UploadBar, ABreakAndWhatWasThereBeforeDoNotCountAsRate) {
  UploadBar bar;
  bar.Line({40, 100, 80'000'000, false}, 0);  // an upload that goes on
  EXPECT_EQ(bar.Line({40, 100, 80'000'000, true}, 30),
            "[=========>              ] 40 %, 40 of 100 scans, waiting for the server");
  EXPECT_EQ(bar.Line({50, 100, 100'000'000, false}, 31),
            "[============>           ] 50 %, 50 of 100 scans, 20.0 MB/s, 0:05 left");
}

}  // namespace
}  // namespace mapkeep
