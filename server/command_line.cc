#include "server/command_line.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>
#include <toml++/toml.h>

#include <CLI/CLI.hpp>
#include <fstream>
#include <map>
#include <sstream>
#include <string_view>
#include <utility>
#include <vector>

#include "server/exposure.h"
#include "server/settings.h"

namespace mapkeep {
namespace {

constexpr char kVersion[] = "mapkeepd 0.1.0\n";
constexpr char kBoolean[] = "true or false";  // what such a setting expects

std::string Place(const std::string& file, const toml::source_region& source) {
  return absl::StrFormat("%s:%d", file, source.begin.line);
}

SettingValue ValueOf(const toml::node& node) {
  if (const auto* text = node.as_string()) return text->get();
  if (const auto* integer = node.as_integer()) return integer->get();
  if (const auto* number = node.as_floating_point()) return number->get();
  if (const auto* boolean = node.as_boolean()) return boolean->get();
  return std::monostate{};
}

std::string Written(const toml::node& node) {
  std::ostringstream out;
  out << toml::node_view<const toml::node>(node);
  return out.str();
}

// The keys of a table ("": those outside of one), as an error lists them.
std::string KnownKeys(std::string_view table) {
  std::vector<std::string> known;
  for (const Setting& setting : Settings()) {
    const std::string_view name = setting.name;
    const size_t dot = name.find('.');
    const std::string_view of = dot == std::string_view::npos ? "" : name.substr(0, dot);
    if (of != table) continue;
    known.emplace_back(dot == std::string_view::npos ? name : name.substr(dot + 1));
  }
  return absl::StrJoin(known, ", ");
}

absl::Status Assign(const std::string& name, const toml::node& node, const std::string& file, Config& config) {
  const std::string place = Place(file, node.source());
  const Setting* setting = FindSetting(name);
  if (setting == nullptr) {
    const size_t dot = name.find('.');
    const std::string table = dot == std::string::npos ? "" : name.substr(0, dot);
    return absl::InvalidArgumentError(
        absl::StrFormat("%s: unknown key \"%s\", expected one of: %s", place, name, KnownKeys(table)));
  }
  if (!setting->assign(config, ValueOf(node))) {
    return absl::InvalidArgumentError(
        absl::StrFormat("%s: %s = %s: expected %s", place, name, Written(node), setting->expects));
  }
  return absl::OkStatus();
}

absl::Status ApplyTable(const toml::table& root, const std::string& file, Config& config) {
  for (const auto& [key, node] : root) {
    const std::string name(key.str());
    const toml::table* table = node.as_table();
    if (table == nullptr) {
      if (absl::Status status = Assign(name, node, file, config); !status.ok()) return status;
      continue;
    }
    if (KnownKeys(name).empty()) {
      return absl::InvalidArgumentError(
          absl::StrFormat("%s: unknown table [%s], expected one of: [rados], [history], [limits], [quota], [align], [clean], "
                          "[merge], [filter]",
                          Place(file, node.source()), name));
    }
    for (const auto& [inner, value] : *table) {
      absl::Status status = Assign(absl::StrCat(name, ".", std::string(inner.str())), value, file, config);
      if (!status.ok()) return status;
    }
  }
  return absl::OkStatus();
}

absl::Status ApplyFile(const std::string& file, Config& config) {
  std::ifstream in(file);
  if (!in) return absl::InvalidArgumentError(absl::StrCat("--config ", file, ": cannot be read"));
  std::ostringstream text;
  text << in.rdbuf();
  return ApplyToml(text.str(), file, config);
}

std::string SettingsHelp() {
  const Config defaults;
  std::string text = "In the file, the flags above (with _ for -) and, by table:\n";
  std::string table;
  for (const Setting& setting : Settings()) {
    const size_t dot = setting.name.find('.');
    if (dot == std::string::npos) continue;
    if (setting.name.substr(0, dot) != table) {
      table = setting.name.substr(0, dot);
      absl::StrAppend(&text, "\n[", table, "]\n");
    }
    absl::StrAppendFormat(&text, "  %s = %s\n      %s; %s\n", setting.name.substr(dot + 1), setting.show(defaults),
                          setting.about, setting.expects);
  }
  return text;
}

}  // namespace

absl::Status ApplyToml(const std::string& text, const std::string& file, Config& config) {
  try {
    const toml::table root = toml::parse(text, file);
    return ApplyTable(root, file, config);
  } catch (const toml::parse_error& error) {  // the library's way to report; it goes no further
    return absl::InvalidArgumentError(absl::StrFormat("%s: %s", Place(file, error.source()), error.description()));
  }
}

absl::StatusOr<std::variant<Config, PrintAndLeave>> ReadCommandLine(int argc, const char* const* argv) {
  CLI::App app("mapkeepd keeps clean LiDAR maps: sessions in, static map out.", "mapkeepd");
  std::string file;
  app.add_option("--config", file, "TOML file; flags win over it")->type_name("FILE");
  app.set_version_flag("--version", kVersion);
  std::map<std::string, std::string> given;
  const Config defaults;
  for (const Setting& setting : Settings()) {
    const std::string flag = FlagOf(setting);
    if (flag.empty()) continue;
    const std::string value = setting.show(defaults);
    CLI::Option* option = app.add_option_function<std::string>(
        flag, [&given, &setting](const std::string& text) { given[setting.name] = text; },
        absl::StrCat(setting.about, "; ", setting.expects, value.empty() ? "" : absl::StrCat(" [", value, "]")));
    option->type_name("");
    if (setting.expects == kBoolean) option->expected(0, 1);  // the flag alone says yes
  }
  app.footer(SettingsHelp());
  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp&) {  // the library's way to report; it goes no further
    return PrintAndLeave{app.help()};
  } catch (const CLI::CallForVersion&) {
    return PrintAndLeave{kVersion};
  } catch (const CLI::ParseError& error) {
    return absl::InvalidArgumentError(absl::StrCat(error.what(), " (mapkeepd --help lists the flags)"));
  }
  Config config;
  if (!file.empty()) {
    if (absl::Status status = ApplyFile(file, config); !status.ok()) return status;
  }
  for (const auto& [name, text] : given) {
    const Setting* setting = FindSetting(name);
    const bool alone = text.empty() && setting->expects == kBoolean;
    if (!setting->assign(config, FlagText{alone ? "true" : text})) {
      return absl::InvalidArgumentError(
          absl::StrFormat("%s %s: expected %s", FlagOf(*setting), text, setting->expects));
    }
  }
  if (absl::Status status = CheckExposure(config); !status.ok()) return status;
  return config;
}

}  // namespace mapkeep
