#include "server/settings.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <set>
#include <sstream>

namespace mapkeep {
namespace {

using ::testing::HasSubstr;

TEST(Settings, EveryDefaultIsAmongTheValuesThatItsSettingTakes) {
  for (const Setting& setting : Settings()) {
    Config config;
    const std::string shown = setting.show(config);
    EXPECT_TRUE(setting.assign(config, FlagText{shown})) << setting.name << " = " << shown;
    EXPECT_EQ(setting.show(config), shown) << setting.name;
  }
}

TEST(Settings, NoNameComesTwiceAndEachIsExplained) {
  std::set<std::string> names;
  for (const Setting& setting : Settings()) {
    EXPECT_TRUE(names.insert(setting.name).second) << setting.name;
    EXPECT_FALSE(setting.about.empty()) << setting.name;
    EXPECT_FALSE(setting.expects.empty()) << setting.name;
  }
}

TEST(Settings, NoneTakesAValueOfAnotherType) {
  for (const Setting& setting : Settings()) {
    Config config;
    EXPECT_FALSE(setting.assign(config, std::monostate{})) << setting.name;
    const bool is_text =
        setting.assign(config, std::string("127.0.0.1:1")) || setting.assign(config, std::string("text"));
    const bool is_number = setting.assign(config, int64_t{1});
    EXPECT_FALSE(is_text && is_number) << setting.name;
  }
}

TEST(Settings, TheReadmeShowsTheTable) {
  std::ifstream file(MAPKEEP_SOURCE_DIR "/server/README.md");
  std::ostringstream readme;
  readme << file.rdbuf();
  EXPECT_THAT(readme.str(), HasSubstr(SettingsTable()));
}

TEST(Settings, AddressesHaveAHostAndAPort) {
  const Setting& listen = *FindSetting("listen");
  Config config;
  EXPECT_TRUE(listen.assign(config, FlagText{"[::1]:0"}));
  EXPECT_EQ(config.listen, (Endpoint{"::1", 0}));
  EXPECT_EQ(ToString(config.listen), "[::1]:0");
  EXPECT_TRUE(listen.assign(config, FlagText{"maps.local:65535"}));
  for (const char* bad : {"", "7443", ":7443", "host:", "host:x", "host:65536", "host:-1", "::1:7443"}) {
    EXPECT_FALSE(listen.assign(config, FlagText{bad})) << bad;
  }
  EXPECT_EQ(config.listen, (Endpoint{"maps.local", 65535}));
}

}  // namespace
}  // namespace mapkeep
