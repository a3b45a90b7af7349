#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "server/config.h"

namespace mapkeep {

/// A value as a flag gives it: text that a setting reads as what it is.
struct FlagText {
  std::string text;
};

/// What may stand behind a key: a flag's text, or a value of the file. monostate: of a type that no setting has.
using SettingValue = std::variant<std::monostate, FlagText, bool, int64_t, double, std::string>;

/// One thing that can be set. Those without a dot in their name are flags as well (`log_format` is --log-format).
struct Setting {
  std::string name;     ///< in the file: "listen", or "align.min_fitness" for min_fitness in the table [align]
  std::string expects;  ///< what a value must be, as errors and --help say it
  std::string about;    ///< what it does, with its unit and the paper's symbol
  std::function<std::string(const Config&)> show;            ///< its value as text
  std::function<bool(Config&, const SettingValue&)> assign;  ///< false: not what is expected, nothing is changed
};

/// The one table of settings: it makes --help, the check of files and flags, and the table of server/README.md.
const std::vector<Setting>& Settings();

/// nullptr if there is none of that name.
const Setting* FindSetting(std::string_view name);

/// "--log-format" for log_format; empty for a setting that is no flag.
std::string FlagOf(const Setting& setting);

/// The table in Markdown: name, default, what is expected, what it does.
std::string SettingsTable();

}  // namespace mapkeep
