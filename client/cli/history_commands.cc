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
#include "client/cli/interruption.h"
#include "client/cli/output.h"
#include "client/exporters/change_file.h"
#include "client/exporters/map_points.h"

namespace mapkeep {
namespace {

struct HistoryArguments {
  std::string map;
  size_t limit = 20;
  std::string tag;
  std::optional<uint64_t> epoch;
  bool remove = false;
  uint64_t before = 0, after = 0;
  std::string file;
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

ExitCode Diff(const GlobalOptions& options, const HistoryArguments& arguments) {
  std::optional<ChangeFileWriter> writer;
  MapSnapshot snapshot;
  uint64_t appeared = 0, disappeared = 0, blocks = 0;
  const Interruption interruption;
  const auto add = [&](const std::optional<Block>& block, Change change, uint64_t& count) {
    if (!block) return;
    count += block->voxels.size();
    if (!writer) return;
    ForEachPoint(*block, snapshot.voxel_size, PointDetail::kSubVoxels, std::nullopt,
                 [&](const Eigen::Vector3d& point, float) { writer->Add(point, change); });
  };
  absl::Status status = options.Connect().CompareEpochs(
      arguments.map, arguments.before, arguments.after,
      [&](const MapSnapshot& header) -> absl::Status {
        snapshot = header;
        if (arguments.file.empty()) return absl::OkStatus();
        auto created = ChangeFileWriter::Create(
            arguments.file, absl::StrFormat("%s from epoch %d to %d: green appeared, red disappeared", arguments.map,
                                            arguments.before, arguments.after));
        if (!created.ok()) return created.status();
        writer.emplace(*std::move(created));
        return absl::OkStatus();
      },
      [&](const BlockChangeInfo& change) -> absl::Status {
        if (interruption.requested()) return absl::CancelledError("stopped");
        ++blocks;
        add(change.appeared, Change::kAppeared, appeared);
        add(change.disappeared, Change::kDisappeared, disappeared);
        return absl::OkStatus();
      });
  if (status.ok() && writer) status = writer->Finish();
  if (!status.ok()) return Fail(status);
  if (options.json) {
    PrintJson({{"map", arguments.map},
               {"before", arguments.before},
               {"after", arguments.after},
               {"appeared", appeared},
               {"disappeared", disappeared},
               {"blocks", blocks},
               {"points", writer ? writer->count() : 0}});
  } else {
    std::cout << absl::StrFormat("%s from epoch %d to %d: %d static voxels appeared, %d disappeared, in %d blocks\n",
                                 arguments.map, arguments.before, arguments.after, appeared, disappeared, blocks);
  }
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
  {
    const auto [command, arguments] = add("diff", "Tell what static structure appeared and disappeared", Diff);
    command->add_option("A", arguments->before, "Earlier epoch")->required();
    command->add_option("B", arguments->after, "Later epoch")->required();
    command->add_option("OUT", arguments->file, "Coloured points, .ply: green appeared, red disappeared");
  }
}

}  // namespace mapkeep
