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

struct AdminArguments {
  std::string map, directory, as;
  std::optional<uint64_t> epoch;
  bool dry_run = false;
};

ExitCode Check(const GlobalOptions& options, const AdminArguments& arguments) {
  const absl::StatusOr<VerificationInfo> found = options.Connect().VerifyMap(arguments.map);
  if (!found.ok()) return Fail(found.status());
  if (options.json) {
    PrintJson({{"map", arguments.map},
               {"epochs", found->epochs},
               {"nodes", found->nodes},
               {"blocks", found->blocks},
               {"voxels", found->voxels},
               {"problem_count", found->problem_count},
               {"problems", found->problems}});
  } else {
    std::cout << absl::StrFormat(
        "%s: %d epochs, %d tree nodes, %d blocks, %d voxels read: %s\n", arguments.map, found->epochs, found->nodes,
        found->blocks, found->voxels,
        found->problem_count == 0 ? "all is well" : absl::StrCat(found->problem_count, " problems"));
    for (const std::string& problem : found->problems) std::cout << problem << '\n';
  }
  return found->problem_count == 0 ? ExitCode::kDone : ExitCode::kFailed;
}

ExitCode Collect(const GlobalOptions& options, const AdminArguments& arguments) {
  const absl::StatusOr<GarbageInfo> counts = options.Connect().CollectGarbage(arguments.dry_run);
  if (!counts.ok()) return Fail(counts.status());
  if (options.json) {
    PrintJson({{"dry_run", arguments.dry_run},
               {"epochs", counts->epochs},
               {"values", counts->values},
               {"attempts", counts->attempts},
               {"maps", counts->maps},
               {"sessions", counts->sessions}});
  } else {
    std::cout << absl::StrFormat(
        "%s: %d epochs, %d values, %d unfinished commits, %d deleted maps, %d unfinished deletions\n",
        arguments.dry_run ? "would go" : "gone", counts->epochs, counts->values, counts->attempts, counts->maps,
        counts->sessions);
  }
  return ExitCode::kDone;
}

ExitCode PrintMaps(const GlobalOptions& options, const std::string& directory, const char* what,
                   const absl::StatusOr<std::vector<std::string>>& maps) {
  if (!maps.ok()) return Fail(maps.status());
  if (options.json) {
    PrintJson({{"directory", directory}, {"maps", *maps}});
  } else {
    std::cout << absl::StrFormat("%s: %s %d maps: %s\n", directory, what, maps->size(), absl::StrJoin(*maps, " "));
  }
  return ExitCode::kDone;
}

ExitCode Backup(const GlobalOptions& options, const AdminArguments& arguments) {
  return PrintMaps(options, arguments.directory, "holds",
                   options.Connect().Backup(arguments.directory, arguments.map, arguments.epoch));
}

ExitCode Restore(const GlobalOptions& options, const AdminArguments& arguments) {
  return PrintMaps(options, arguments.directory, "restored",
                   options.Connect().Restore(arguments.directory, arguments.map, arguments.as));
}

ExitCode Replay(const GlobalOptions& options, const AdminArguments& arguments) {
  const absl::StatusOr<ReplayInfo> report = options.Connect().ReplayMap(arguments.map);
  if (!report.ok()) return Fail(report.status());
  if (options.json) {
    PrintJson({{"map", arguments.map},
               {"commits", report->commits},
               {"blocks", report->blocks},
               {"different", report->different},
               {"first_difference", report->first_difference}});
  } else {
    std::cout << absl::StrFormat("%s: %d commits made again, %d blocks compared, %d differ\n", arguments.map,
                                 report->commits, report->blocks, report->different);
    if (report->different > 0) std::cout << report->first_difference << '\n';
  }
  return report->different == 0 ? ExitCode::kDone : ExitCode::kFailed;
}

}  // namespace

void AddAdminCommands(CommandLine& line) {
  CLI::App* group = line.app.add_subcommand("admin", "Look after a daemon's store");
  group->require_subcommand(1);
  const auto add = [&line, group](const char* name, const char* about, auto run) {
    auto arguments = std::make_shared<AdminArguments>();
    CLI::App* command = group->add_subcommand(name, about);
    command->callback(
        [&line, arguments, run] { line.action = [&line, arguments, run] { return run(line.options, *arguments); }; });
    return std::pair(command, arguments);
  };
  {
    const auto [command, arguments] = add("check", "Read everything of a map and verify it", Check);
    command->add_option("MAP", arguments->map)->required()->check(NameValidator());
  }
  {
    const auto [command, arguments] = add("gc", "Take away what nobody can need any more, now", Collect);
    command->add_flag("--dry-run", arguments->dry_run, "Tell only what would go");
  }
  {
    const auto [command, arguments] = add("backup", "Copy the store while it is served", Backup);
    command->add_option("DIR", arguments->directory, "To be made on the daemon's machine, an absolute path")
        ->required();
    command->add_option("--map", arguments->map, "RADOS: the map")->check(NameValidator());
    command->add_option("--epoch", arguments->epoch, "RADOS: of the map; the newest by default");
  }
  {
    const auto [command, arguments] = add("restore", "Take maps out of a backup", Restore);
    command->add_option("DIR", arguments->directory, "Of the backup, on the daemon's machine")->required();
    command->add_option("--map", arguments->map, "Only this one")->check(NameValidator());
    command->add_option("--as", arguments->as, "Under this name")->check(NameValidator());
  }
  {
    const auto [command, arguments] = add("replay", "Make a map again from its kept scans and compare", Replay);
    command->add_option("MAP", arguments->map)->required()->check(NameValidator());
  }
}

}  // namespace mapkeep
