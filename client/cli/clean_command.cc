#include <absl/status/status.h>
#include <absl/strings/str_format.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "client/cli/ablation.h"
#include "client/cli/command_line.h"
#include "client/cli/interruption.h"
#include "client/cli/offline_cleaning.h"
#include "client/cli/output.h"
#include "client/cli/progress_line.h"
#include "client/cli/session_input.h"
#include "client/exporters/output_file.h"

namespace mapkeep {
namespace {

struct CleanArguments {
  SessionInput input;
  std::string out;
  int threads = 0;  ///< 0: one a core
  bool ablation = false;
};

double MillisecondsPerScan(const CleaningReport& report) {
  return 1000 * (report.remove_seconds + report.label_seconds) / static_cast<double>(report.scans);
}

nlohmann::json JsonOf(const CleaningReport& report, int threads) {
  return {{"scans", report.scans},
          {"points", report.points},
          {"points_removed", report.points_removed},
          {"points_restored", report.points_restored},
          {"no_returns", report.no_returns},
          {"voxels", report.voxels},
          {"dynamic_voxels", report.dynamic_voxels},
          {"ground_voxels", report.ground_voxels},
          {"threads", threads},
          {"seconds",
           {{"read", report.read_seconds},
            {"remove", report.remove_seconds},
            {"label", report.label_seconds},
            {"write", report.write_seconds}}},
          {"ms_per_scan", MillisecondsPerScan(report)},
          {"ms_per_scan_includes_file_reading", report.removal_reads_files}};
}

void PrintReport(const CleaningReport& report, const std::string& out) {
  PrintFields({{"scans", absl::StrFormat("%d", report.scans)},
               {"points",
                absl::StrFormat("%d, removed %d (%.2f %%), restored %d", report.points, report.points_removed,
                                100.0 * static_cast<double>(report.points_removed) / static_cast<double>(report.points),
                                report.points_restored)},
               {"voxels", absl::StrFormat("%d, of which %d moved and %d are ground", report.voxels,
                                          report.dynamic_voxels, report.ground_voxels)},
               {"seconds", absl::StrFormat("read %.2f, remove %.2f, label %.2f, write %.2f", report.read_seconds,
                                           report.remove_seconds, report.label_seconds, report.write_seconds)},
               {"ms a scan", absl::StrFormat("%.1f%s", MillisecondsPerScan(report),
                                             report.removal_reads_files ? " with file reading" : "")},
               {"written to", out}});
}

absl::Status WriteReport(const std::filesystem::path& path, const nlohmann::json& report) {
  absl::StatusOr<OutputFile> file = OutputFile::Create(path);
  if (!file.ok()) return file.status();
  file->stream() << report.dump(2) << '\n';
  return file->Finish();
}

/// What cannot be written, or was stopped, is a failure; anything else lies in the session.
ExitCode ReportCleaningError(const absl::Status& status) {
  return absl::IsFailedPrecondition(status) || absl::IsUnknown(status) ? Fail(status) : BadInput(status);
}

ExitCode Clean(const GlobalOptions& options, const CleanArguments& arguments) {
  const int threads = arguments.threads > 0 ? arguments.threads : tbb::info::default_concurrency();
  const absl::StatusOr<SessionDirectory> directory = OpenSessionInput(arguments.input);
  if (!directory.ok()) return BadInput(directory.status());
  const Interruption interruption;
  ProgressLine line(options.json);
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<size_t>(threads));
  absl::StatusOr<CleaningReport> report = absl::InternalError("not run");
  tbb::task_arena(threads).execute([&] {
    report = CleanSession(*directory, arguments.out, [&](const std::string& stage, double fraction) {
      line.Show(stage, fraction);
      return !interruption.requested();
    });
  });
  line.Clear();
  if (!report.ok()) return ReportCleaningError(report.status());
  const nlohmann::json json = JsonOf(*report, threads);
  const absl::Status written = WriteReport(std::filesystem::path(arguments.out) / "report.json", json);
  if (!written.ok()) return Fail(written);
  if (options.json) {
    PrintJson(json);
  } else {
    PrintReport(*report, arguments.out);
  }
  return ExitCode::kDone;
}

void PrintAblation(const std::vector<AblationRow>& rows) {
  std::cout << absl::StrFormat("%-20s%8s%8s%8s%10s\n", "refinements", "SA %", "DA %", "AA %", "ms/scan");
  for (const AblationRow& row : rows) {
    std::cout << absl::StrFormat("%-20s%8.2f%8.2f%8.2f%10.1f\n", row.name, row.score.sa(), row.score.da(),
                                 row.score.aa(), row.ms_per_scan);
  }
}

nlohmann::json JsonOf(const std::vector<AblationRow>& rows) {
  nlohmann::json json = nlohmann::json::array();
  for (const AblationRow& row : rows) {
    json.push_back({{"refinements", row.name},
                    {"SA", row.score.sa()},
                    {"DA", row.score.da()},
                    {"AA", row.score.aa()},
                    {"ms_per_scan", row.ms_per_scan}});
  }
  return json;
}

ExitCode Ablate(const GlobalOptions& options, const CleanArguments& arguments) {
  const int threads = arguments.threads > 0 ? arguments.threads : tbb::info::default_concurrency();
  const absl::StatusOr<SessionDirectory> directory = OpenSessionInput(arguments.input);
  if (!directory.ok()) return BadInput(directory.status());
  const Interruption interruption;
  ProgressLine line(options.json);
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<size_t>(threads));
  absl::StatusOr<std::vector<AblationRow>> rows = absl::InternalError("not run");
  tbb::task_arena(threads).execute([&] {
    const absl::StatusOr<LabelledSession> session = ReadLabelledSession(*directory);
    if (!session.ok()) {
      rows = session.status();
      return;
    }
    rows = RunAblation(
        session->scans, session->poses, AblationSteps(),
        [&](std::span<const std::vector<PointLabel>> labels) { return ScoreLabels(session->truth, labels); },
        [&](const std::string& step, double fraction) {
          line.Show(step, fraction);
          return !interruption.requested();
        });
  });
  line.Clear();
  if (!rows.ok()) return absl::IsCancelled(rows.status()) ? Fail(rows.status()) : BadInput(rows.status());
  if (options.json) {
    PrintJson(JsonOf(*rows));
  } else {
    PrintAblation(*rows);
  }
  return ExitCode::kDone;
}

ExitCode CleanOrAblate(const GlobalOptions& options, const CleanArguments& arguments) {
  if (arguments.ablation) return Ablate(options, arguments);
  if (arguments.out.empty()) return BadInput(absl::InvalidArgumentError("OUT is required"));
  return Clean(options, arguments);
}

}  // namespace

void AddCleanCommand(CommandLine& line) {
  CLI::App* command = line.app.add_subcommand("clean", "Remove what moved from a session directory, without a server");
  auto arguments = std::make_shared<CleanArguments>();
  AddSessionInput(*command, arguments->input);
  CLI::Option* out = command->add_option("OUT", arguments->out,
                                         "Directory for labels/, static.pcd and report.json; made if it is not there");
  command
      ->add_flag("--ablation", arguments->ablation,
                 "Write nothing; print SA, DA, AA and ms a scan without and with each refinement. DIR needs label/")
      ->excludes(out);
  command->add_option("--threads", arguments->threads, "Threads to work on; by default one a core")
      ->type_name("N")
      ->check(CLI::Range(1, 1024));
  command->callback(
      [&line, arguments] { line.action = [&line, arguments] { return CleanOrAblate(line.options, *arguments); }; });
}

}  // namespace mapkeep
