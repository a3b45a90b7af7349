#include "server/command_line.h"

#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "server/settings.h"

namespace mapkeep {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

absl::StatusOr<std::variant<Config, PrintAndLeave>> Read(std::vector<const char*> words) {
  words.insert(words.begin(), "mapkeepd");
  return ReadCommandLine(static_cast<int>(words.size()), words.data());
}

std::string FlagComplaint(const std::vector<const char*>& words) {
  const auto result = Read(words);
  return result.ok() ? "" : std::string(result.status().message());
}

std::string FileComplaint(const std::string& text) {
  Config config;
  return std::string(ApplyToml(text, "site.toml", config).message());
}

TEST(CommandLine, WithoutFlagsEverythingIsAsDocumented) {
  const auto result = Read({});
  ASSERT_TRUE(result.ok()) << result.status();
  const auto& config = std::get<Config>(*result);
  for (const Setting& setting : Settings()) EXPECT_EQ(setting.show(config), setting.show(Config())) << setting.name;
  EXPECT_EQ(ToString(config.listen), "127.0.0.1:7443");
  EXPECT_EQ(ToString(config.admin), "127.0.0.1:7444");
  EXPECT_EQ(ToString(config.http), "");
}

TEST(CommandLine, FlagsWinOverTheFile) {
  const std::string file = ::testing::TempDir() + "flags_win.toml";
  std::ofstream(file) << "threads = 3\ndata = \"from-file\"\n[align]\nmin_fitness = 0.5\n";
  const auto result = Read({"--threads", "2", "--config", file.c_str()});
  ASSERT_TRUE(result.ok()) << result.status();
  const auto& config = std::get<Config>(*result);
  EXPECT_EQ(config.threads, 2);
  EXPECT_EQ(config.data, "from-file");
  EXPECT_EQ(config.stages.align.min_fitness, 0.5);
  std::filesystem::remove(file);
}

TEST(CommandLine, HelpNamesEverySettingWithItsDefault) {
  const auto result = Read({"--help"});
  ASSERT_TRUE(result.ok());
  const std::string text = std::get<PrintAndLeave>(*result).text;
  for (const Setting& setting : Settings()) {
    const std::string flag = FlagOf(setting);
    const std::string name = flag.empty() ? setting.name.substr(setting.name.find('.') + 1) + " = " : flag;
    EXPECT_THAT(text, AllOf(HasSubstr(name), HasSubstr(setting.show(Config()))));
  }
}

TEST(CommandLine, ASwitchNeedsNoValueAndTakesOne) {
  EXPECT_FALSE(std::get<Config>(*Read({})).serial_per_map);
  EXPECT_TRUE(std::get<Config>(*Read({"--serial-per-map"})).serial_per_map);
  EXPECT_EQ(std::get<Config>(*Read({"--serial-per-map", "--threads", "2"})).threads, 2);
  EXPECT_FALSE(std::get<Config>(*Read({"--serial-per-map=false"})).serial_per_map);
  EXPECT_THAT(FlagComplaint({"--serial-per-map=perhaps"}), HasSubstr("expected true or false"));
}

TEST(CommandLine, BadFlagsAreNamedWithWhatWasExpected) {
  EXPECT_THAT(FlagComplaint({"--threads", "many"}), HasSubstr("--threads many: expected an integer from 0 to 1024"));
  EXPECT_THAT(FlagComplaint({"--threads", "-1"}), HasSubstr("expected an integer"));
  EXPECT_THAT(FlagComplaint({"--listen", "7443"}), HasSubstr("--listen 7443: expected HOST:PORT"));
  EXPECT_THAT(FlagComplaint({"--log-format", "xml"}), HasSubstr("expected text or json"));
  EXPECT_THAT(FlagComplaint({"--data", ""}), HasSubstr("expected a directory"));
  EXPECT_THAT(FlagComplaint({"--frobnicate"}), HasSubstr("--frobnicate"));
  EXPECT_THAT(FlagComplaint({"stray"}), HasSubstr("stray"));
  EXPECT_THAT(FlagComplaint({"--config", "/nowhere/x.toml"}), HasSubstr("/nowhere/x.toml: cannot be read"));
}

TEST(CommandLine, UnknownKeysAndTablesAreNamedWithTheirLineAndTheKnownOnes) {
  EXPECT_THAT(FileComplaint("threads = 1\nthread = 1\n"),
              AllOf(StartsWith("site.toml:2: unknown key \"thread\""), HasSubstr("threads")));
  EXPECT_THAT(FileComplaint("\n\n[align]\nmin_fitnes = 0.5\n"),
              AllOf(StartsWith("site.toml:4: unknown key \"align.min_fitnes\""), HasSubstr("min_fitness")));
  EXPECT_THAT(FileComplaint("[aline]\nx = 1\n"),
              AllOf(StartsWith("site.toml:1: unknown table [aline]"), HasSubstr("[align]")));
  EXPECT_THAT(FileComplaint("[align.deep]\nx = 1\n"), StartsWith("site.toml:1: unknown key \"align.deep\""));
  EXPECT_THAT(FileComplaint("[[align]]\nx = 1\n"), StartsWith("site.toml:1: unknown key \"align\""));
}

TEST(CommandLine, BadSyntaxIsNamedWithItsLine) {
  EXPECT_THAT(FileComplaint("threads = 1\ndata = \n"), StartsWith("site.toml:2: "));
  EXPECT_THAT(FileComplaint("threads = 1\nthreads = 2\n"), StartsWith("site.toml:2: "));
  EXPECT_THAT(FileComplaint(std::string("data = \"\xff\xfe\"\n")), StartsWith("site.toml:1: "));
}

TEST(CommandLine, EverySettingRefusesABadValueWithItsLine) {
  for (const Setting& setting : Settings()) {
    const size_t dot = setting.name.find('.');
    const std::string table = dot == std::string::npos ? "" : absl::StrCat("[", setting.name.substr(0, dot), "]");
    const std::string key = dot == std::string::npos ? setting.name : setting.name.substr(dot + 1);
    for (const char* bad : {"[1, 2]", "1979-05-27", "-1e300"}) {
      const std::string complaint = FileComplaint(absl::StrCat(table, "\n", key, " = ", bad, "\n"));
      EXPECT_THAT(complaint, AllOf(StartsWith(absl::StrCat("site.toml:2: ", setting.name, " = ")),
                                   HasSubstr(absl::StrCat("expected ", setting.expects))));
    }
  }
}

TEST(CommandLine, NumbersOutsideTheirRangeAreRefused) {
  EXPECT_THAT(FileComplaint("[align]\nmin_fitness = 1.5\n"),
              HasSubstr("align.min_fitness = 1.5: expected a number from 0 to 1"));
  EXPECT_THAT(FileComplaint("[align]\nmin_fitness = nan\n"), HasSubstr("expected a number from 0 to 1"));
  EXPECT_THAT(FileComplaint("threads = 1.5\n"), HasSubstr("expected an integer"));
  EXPECT_EQ(FileComplaint("[align]\nmin_fitness = 1\n"), "");
}

}  // namespace
}  // namespace mapkeep
