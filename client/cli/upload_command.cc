#include "client/cli/upload_command.h"

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/time/clock.h>

#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "client/cli/arguments.h"
#include "client/cli/interruption.h"
#include "client/cli/json_values.h"
#include "client/cli/output.h"
#include "client/cli/progress_line.h"
#include "client/cli/session_input.h"
#include "client/cli/session_view.h"
#include "client/cli/upload_bar.h"
#include "client/mapkeep/client.h"
#include "client/mapkeep/scan_checksums.h"
#include "core/checksum/crc32c.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

struct UploadArguments {
  std::string map;
  SessionInput input;
  std::string id;
  std::string robot;
  std::string encoding = "raw";
  double patience = ClientOptions().patience_seconds;
  bool keep_scans = false;
  bool wait = false;
  std::string initial_pose;  ///< empty: unknown
  std::string gnss;          ///< likewise
};

std::string DefaultId(const fs::path& directory, const std::vector<uint32_t>& checksums) {
  std::error_code error;
  const fs::path real = fs::canonical(directory, error);
  const std::string_view bytes(reinterpret_cast<const char*>(checksums.data()), checksums.size() * sizeof(uint32_t));
  return SessionIdFrom(real.filename().string(), Crc32c(bytes));
}

/// What the first part of an upload leaves to the second.
struct Sent {
  SessionInfo session;
  ExitCode exit = ExitCode::kDone;
};

/// Reads and checks everything, and only then sends.
Sent Send(const GlobalOptions& options, const Client& client, const UploadArguments& arguments) {
  const Interruption interruption;
  ProgressLine line(options.json);
  absl::StatusOr<SessionDirectory> directory = OpenSessionInput(arguments.input);
  if (!directory.ok()) return {{}, BadInput(directory.status())};
  std::optional<KnownStart> start;
  if (!arguments.initial_pose.empty()) {
    const absl::StatusOr<KnownStart> given = ParseInitialPose("--initial-pose", arguments.initial_pose);
    if (!given.ok()) return {{}, BadInput(given.status())};
    start = *given;
  }
  std::optional<GnssStart> gnss;
  if (!arguments.gnss.empty()) {
    const absl::StatusOr<GnssStart> given = ParseGnss("--gnss", arguments.gnss);
    if (!given.ok()) return {{}, BadInput(given.status())};
    gnss = *given;
  }
  const ScanSource scans = SourceOf(*directory);
  const std::optional<ScanEncoding> encoding = ScanEncodingNamed(arguments.encoding);
  if (!encoding) {
    return {{},
            BadInput(absl::InvalidArgumentError(
                absl::StrFormat("--encoding %s: expected raw, draco-1cm or draco-1mm", arguments.encoding)))};
  }
  const auto checking = [&](double fraction) {
    line.Show("checking", fraction);
    return !interruption.requested();
  };
  const auto checksums = ScanChecksums(scans, directory->poses, checking, *encoding);
  line.Clear();
  if (!checksums.ok()) return {{}, BadInput(checksums.status())};

  const SessionUpload upload{
      .map = arguments.map,
      .id = arguments.id.empty() ? DefaultId(arguments.input.directory, *checksums) : arguments.id,
      .robot = arguments.robot,
      .keep_scans = arguments.keep_scans,
      .scans = scans,
      .poses = directory->poses,
      .checksums = *checksums,
      .encoding = *encoding,
      .start = start,
      .gnss = gnss};
  UploadBar bar;
  const absl::Time began = absl::Now();
  absl::StatusOr<SessionInfo> session = client.UploadSession(upload, [&](const UploadProgress& progress) {
    line.ShowText("uploading", bar.Line(progress, absl::ToDoubleSeconds(absl::Now() - began)));
    return !interruption.requested();
  });
  line.Clear();
  if (absl::IsCancelled(session.status())) {
    PrintError("stopped; the same command goes on from there");
    return {{}, ExitCode::kFailed};
  }
  if (!session.ok()) return {{}, Fail(session.status())};
  return {*std::move(session)};
}

ExitCode Upload(const GlobalOptions& options, const UploadArguments& arguments) {
  ClientOptions patient = options.client;
  patient.patience_seconds = arguments.patience;
  const Client client(patient);
  const Sent sent = Send(options, client, arguments);
  if (sent.exit != ExitCode::kDone) return sent.exit;
  if (arguments.wait) return WatchToTheEnd(options, client, arguments.map, sent.session.id);
  if (options.json) {
    PrintJson(JsonOf(sent.session));
  } else {
    std::cout << absl::StrFormat("session %s: %s, %d scans\n", sent.session.id, NameOf(sent.session.state),
                                 sent.session.scan_count);
  }
  return ExitCode::kDone;
}

}  // namespace

void AddUploadCommand(CommandLine& line, CLI::App& group) {
  CLI::App* command = group.add_subcommand("upload", "Upload a session directory; an upload that broke off is resumed");
  auto arguments = std::make_shared<UploadArguments>();
  command->add_option("MAP", arguments->map)->required()->check(NameValidator());
  AddSessionInput(*command, arguments->input);
  command->add_option("--id", arguments->id, "Id of the session; by default the directory's name and a checksum")
      ->check(NameValidator());
  command->add_option("--robot", arguments->robot, "Who drove");
  command
      ->add_option("--encoding", arguments->encoding,
                   "How points travel: raw, or draco-1cm or draco-1mm, rounded to that and a third or half as long")
      ->check(CLI::IsMember({"raw", "draco-1cm", "draco-1mm"}))
      ->capture_default_str();
  command
      ->add_option("--patience", arguments->patience,
                   "Seconds without progress that the upload outlasts, once begun, while the server is away")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command->add_flag("--keep-scans", arguments->keep_scans, "Keep the scans on the server after the commit");
  command
      ->add_option("--initial-pose", arguments->initial_pose,
                   "Where the first scan was taken, in metres and degrees: looked for there first")
      ->type_name("X,Y,Z,YAW");
  command
      ->add_option(
          "--gnss", arguments->gnss,
          "Where the first scan was taken by GNSS, in the map's CRS, and its deviations, metres: looked for there")
      ->type_name("X,Y,Z,SIGMA_LEVEL,SIGMA_HEIGHT");
  command->add_flag("--wait", arguments->wait, "Wait until it is merged: exit 0 only if it was committed");
  command->callback(
      [&line, arguments] { line.action = [&line, arguments] { return Upload(line.options, *arguments); }; });
}

}  // namespace mapkeep
