#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "client/cli/command_line.h"
#include "client/cli/output.h"

namespace mapkeep {
namespace {

struct HistoryArguments {
  std::string map;
  size_t limit = 20;
  std::string tag;
  std::optional<uint64_t> epoch;
  bool remove = false;
};

std::string Describe(const VersionInfo& version) {
  if (version.rollback) return absl::StrCat("rollback to ", version.base_epoch);
  return version.epoch == 0 ? "created" : version.session;
}

nlohmann::json JsonOf(const VersionInfo& version) {
  nlohmann::json json = {
      {"epoch", version.epoch},       {"session", version.session}, {"base_epoch", version.base_epoch},
      {"rollback", version.rollback}, {"time", version.time},       {"touched_tiles", version.touched_tiles},
      {"readable", version.readable}, {"tags", version.tags}};
  if (version.readable) {
    json["voxels"] = version.voxels;
    json["static_voxels"] = version.static_voxels;
    json["sessions"] = version.sessions;
  }
  return json;
}

ExitCode Versions(const GlobalOptions& options, const HistoryArguments& arguments) {
  const auto versions = options.Connect().ListVersions(arguments.map, arguments.limit);
  if (!versions.ok()) return Fail(versions.status());
  if (options.json) {
    nlohmann::json list = nlohmann::json::array();
    for (const VersionInfo& version : *versions) list.push_back(JsonOf(version));
    PrintJson({{"map", arguments.map}, {"versions", list}});
    return ExitCode::kDone;
  }
  std::vector<std::vector<std::string>> rows = {{"EPOCH", "MADE BY", "TIME", "STATIC", "TAGS"}};
  for (const VersionInfo& version : *versions) {
    rows.push_back({absl::StrCat(version.epoch), Describe(version), FormatTime(version.time),
                    version.readable ? absl::StrCat(version.static_voxels) : "collected",
                    version.tags.empty() ? "-" : absl::StrJoin(version.tags, " ")});
  }
  PrintTable(rows);
  return ExitCode::kDone;
}

ExitCode TagEpoch(const GlobalOptions& options, const HistoryArguments& arguments) {
  if (arguments.remove) {
    const absl::Status removed = options.Connect().RemoveTag(arguments.map, arguments.tag);
    if (!removed.ok()) return Fail(removed);
    if (options.json) {
      PrintJson({{"map", arguments.map}, {"removed", arguments.tag}});
    } else {
      std::cout << "removed tag " << arguments.tag << '\n';
    }
    return ExitCode::kDone;
  }
  const absl::StatusOr<uint64_t> epoch = options.Connect().AddTag(arguments.map, arguments.tag, arguments.epoch);
  if (!epoch.ok()) return Fail(epoch.status());
  if (options.json) {
    PrintJson({{"map", arguments.map}, {"tag", arguments.tag}, {"epoch", *epoch}});
  } else {
    std::cout << absl::StrFormat("%s names epoch %d of %s\n", arguments.tag, *epoch, arguments.map);
  }
  return ExitCode::kDone;
}

ExitCode RollBack(const GlobalOptions& options, const HistoryArguments& arguments) {
  const absl::StatusOr<RollbackInfo> rolled = options.Connect().RollBackMap(arguments.map, *arguments.epoch);
  if (!rolled.ok()) return Fail(rolled.status());
  if (options.json) {
    PrintJson({{"map", arguments.map},
               {"epoch", rolled->epoch},
               {"rolled_back", rolled->rolled_back},
               {"brought_back", rolled->brought_back}});
    return ExitCode::kDone;
  }
  std::cout << absl::StrFormat("epoch %d of %s is epoch %d again\n", rolled->epoch, arguments.map, *arguments.epoch);
  for (const std::string& session : rolled->rolled_back) std::cout << "rolled back: " << session << '\n';
  for (const std::string& session : rolled->brought_back) std::cout << "brought back: " << session << '\n';
  return ExitCode::kDone;
}

}  // namespace

void AddHistoryCommands(CommandLine& line, CLI::App& group) {
  const auto add = [&line, &group](const char* name, const char* about, auto run) {
    auto arguments = std::make_shared<HistoryArguments>();
    CLI::App* command = group.add_subcommand(name, about);
    command->add_option("MAP", arguments->map)->required()->check(NameValidator());
    command->callback(
        [&line, arguments, run] { line.action = [&line, arguments, run] { return run(line.options, *arguments); }; });
    return std::pair(command, arguments);
  };
  {
    const auto [command, arguments] = add("versions", "List a map's epochs, newest first", Versions);
    command->add_option("--limit", arguments->limit, "At most so many")
        ->check(CLI::Range(1, 1000000))
        ->capture_default_str();
  }
  {
    const auto [command, arguments] = add("tag", "Name an epoch, which then stays readable", TagEpoch);
    command->add_option("TAG", arguments->tag)->required()->check(NameValidator());
    command->add_option("--epoch", arguments->epoch, "Which one; the newest by default");
    command->add_flag("--delete", arguments->remove, "Take the name away");
  }
  {
    const auto [command, arguments] = add(
        "rollback", "Make a new epoch with the content of an earlier one; later sessions can be tried again", RollBack);
    command->add_option("--epoch", arguments->epoch, "Whose content comes back")->required();
  }
  AddDiffCommand(line, group);
}

}  // namespace mapkeep
