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

#include "client/cli/arguments.h"
#include "client/cli/command_line.h"
#include "client/cli/json_values.h"
#include "client/cli/output.h"
#include "client/cli/session_view.h"
#include "client/cli/upload_command.h"
#include "client/exporters/pose_file.h"

namespace mapkeep {
namespace {

/// Which session, and for `poses` where to.
struct SessionArguments {
  std::string map;
  std::string id;
  std::string file;
  std::string initial_pose;  ///< of `retry`; empty: none
};

ExitCode List(const GlobalOptions& options, const SessionArguments& arguments) {
  const absl::StatusOr<std::vector<SessionInfo>> sessions = options.Connect().ListSessions(arguments.map);
  if (!sessions.ok()) return Fail(sessions.status());
  if (options.json) {
    nlohmann::json list = nlohmann::json::array();
    for (const SessionInfo& session : *sessions) list.push_back(JsonOf(session));
    PrintJson({{"sessions", list}});
    return ExitCode::kDone;
  }
  std::vector<std::vector<std::string>> rows = {{"ID", "STATE", "SCANS", "ROBOT", "CREATED", "REASON"}};
  for (const SessionInfo& session : *sessions) {
    rows.push_back({session.id, std::string(NameOf(session.state)),
                    absl::StrCat(session.durable_scans, "/", session.scan_count), session.robot,
                    FormatTime(session.created), session.reason});
  }
  PrintTable(rows);
  return ExitCode::kDone;
}

ExitCode Show(const GlobalOptions& options, const SessionArguments& arguments) {
  const absl::StatusOr<SessionInfo> session = options.Connect().GetSession(arguments.map, arguments.id);
  if (!session.ok()) return Fail(session.status());
  PrintSession(options, *session);
  return ExitCode::kDone;
}

ExitCode Watch(const GlobalOptions& options, const SessionArguments& arguments) {
  return WatchToTheEnd(options, options.Connect(), arguments.map, arguments.id);
}

ExitCode Retry(const GlobalOptions& options, const SessionArguments& arguments) {
  std::optional<KnownStart> start;
  if (!arguments.initial_pose.empty()) {
    const absl::StatusOr<KnownStart> given = ParseInitialPose("--initial-pose", arguments.initial_pose);
    if (!given.ok()) return BadInput(given.status());
    start = *given;
  }
  const absl::StatusOr<SessionInfo> session = options.Connect().RetrySession(arguments.map, arguments.id, start);
  if (!session.ok()) return Fail(session.status());
  PrintSession(options, *session);
  return ExitCode::kDone;
}

ExitCode Delete(const GlobalOptions& options, const SessionArguments& arguments) {
  const absl::Status deleted = options.Connect().DeleteSession(arguments.map, arguments.id);
  if (!deleted.ok()) return Fail(deleted);
  if (options.json) {
    PrintJson({{"deleted", arguments.id}});
  } else {
    std::cout << "deleted session " << arguments.id << '\n';
  }
  return ExitCode::kDone;
}

ExitCode SavePoses(const GlobalOptions& options, const SessionArguments& arguments) {
  const absl::StatusOr<std::vector<Pose>> poses = options.Connect().ListScanPoses(arguments.map, arguments.id);
  if (!poses.ok()) return Fail(poses.status());
  const absl::Status written = WritePoses(arguments.file, *poses);
  if (!written.ok()) return Fail(written);
  if (options.json) {
    PrintJson({{"file", arguments.file}, {"poses", poses->size()}});
  } else {
    std::cout << arguments.file << ": " << poses->size() << " poses\n";
  }
  return ExitCode::kDone;
}

}  // namespace

void AddSessionCommands(CommandLine& line) {
  CLI::App* group = line.app.add_subcommand("session", "Upload sessions and see what became of them");
  group->require_subcommand(1);
  AddUploadCommand(line, *group);

  auto arguments = std::make_shared<SessionArguments>();
  using Command = ExitCode (*)(const GlobalOptions&, const SessionArguments&);
  const auto add = [&line, group, arguments](const char* name, const char* description, Command command) {
    CLI::App* added = group->add_subcommand(name, description);
    added->add_option("MAP", arguments->map)->required()->check(NameValidator());
    added->callback([&line, arguments, command] {
      line.action = [&line, arguments, command] { return command(line.options, *arguments); };
    });
    return added;
  };
  const auto add_for_one = [&](const char* name, const char* description, Command command) {
    CLI::App* added = add(name, description, command);
    added->add_option("ID", arguments->id)->required()->check(NameValidator());
    return added;
  };
  add("list", "List the sessions of a map", List);
  add_for_one("show", "State and report of a session", Show);
  add_for_one("watch", "Follow a session until it has ended", Watch);
  add_for_one("retry", "Try a refused or failed session once more", Retry)
      ->add_option("--initial-pose", arguments->initial_pose,
                   "X,Y,Z,YAW of its first scan in the map frame, roughly: metres and degrees");
  add_for_one("delete", "Forget a session and its scans; what it merged stays in the map", Delete);
  add_for_one("poses", "Save the aligned poses of its scans in the map frame, 3x4 rows", SavePoses)
      ->add_option("OUT", arguments->file, "Text file to write")
      ->required();
}

}  // namespace mapkeep
