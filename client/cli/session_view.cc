#include "client/cli/session_view.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <iostream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <utility>
#include <vector>

#include "client/cli/json_values.h"
#include "client/cli/output.h"
#include "client/cli/progress_line.h"

namespace mapkeep {
namespace {

constexpr double kDegrees = 180 / std::numbers::pi;

using Fields = std::vector<std::pair<std::string, std::string>>;

void AppendReport(const SessionInfo::Report& report, Fields* fields) {
  if (report.points > 0) {
    fields->emplace_back(
        "points",
        absl::StrFormat("%d, removed %d (%.2f %%), restored %d", report.points, report.points_removed,
                        100.0 * static_cast<double>(report.points_removed) / static_cast<double>(report.points),
                        report.points_restored));
  }
  if (report.session_voxels > 0) fields->emplace_back("voxels seen", absl::StrCat(report.session_voxels));
  if (report.epoch > 0) {
    fields->emplace_back("epoch", absl::StrFormat("%d, aligned to %d", report.epoch, report.base_epoch));
    fields->emplace_back("blocks touched",
                         absl::StrFormat("%d with %d voxels, of which %d static", report.blocks_touched,
                                         report.voxels_kept, report.static_voxels));
  }
  if (!report.stages.empty()) {
    fields->emplace_back(
        "seconds", absl::StrJoin(report.stages, ", ", [](std::string* out, const SessionInfo::StageSeconds& stage) {
          absl::StrAppendFormat(out, "%s %.2f", stage.stage, stage.seconds);
        }));
  }
}

void PrintWindows(const std::vector<SessionInfo::Window>& windows) {
  if (windows.empty()) return;
  std::vector<std::vector<std::string>> rows = {
      {"WINDOW", "FITNESS", "INLIERS", "MOVED_M", "TURNED_DEG", "OBSERVABILITY", "PRECISION", "COVERAGE", "TRUSTED"}};
  for (const SessionInfo::Window& window : windows) {
    rows.push_back({absl::StrFormat("%d-%d", window.first_scan, window.last_scan),
                    absl::StrFormat("%.3f", window.fitness), absl::StrCat(window.inliers),
                    absl::StrFormat("%.3f", window.correction), absl::StrFormat("%.3f", window.rotation * kDegrees),
                    absl::StrFormat("%.3f", window.observability), absl::StrFormat("%.3f", window.precision),
                    absl::StrFormat("%.3f", window.coverage), window.trusted ? "yes" : "no"});
  }
  PrintTable(rows);
}

}  // namespace

void PrintSession(const GlobalOptions& options, const SessionInfo& session) {
  if (options.json) {
    PrintJson(JsonOf(session));
    return;
  }
  std::cout << "state: " << NameOf(session.state) << '\n';
  Fields fields = {{"id", session.id}, {"map", session.map}};
  if (!session.robot.empty()) fields.emplace_back("robot", session.robot);
  if (!session.reason.empty()) fields.emplace_back("reason", session.reason);
  if (session.state == SessionInfo::State::kRunning && !session.stage.empty()) {
    fields.emplace_back("stage", absl::StrFormat("%s %.0f %%", session.stage, 100 * session.stage_progress));
  }
  fields.emplace_back("scans", absl::StrFormat("%d, of which %d arrived%s", session.scan_count, session.durable_scans,
                                               session.keep_scans ? ", kept" : ""));
  if (session.durable_scans > 0) {
    fields.emplace_back("bytes a scan",
                        absl::StrFormat("%d, %.1f MB in all", session.payload_bytes / session.durable_scans,
                                        1e-6 * static_cast<double>(session.payload_bytes)));
  }
  fields.emplace_back("created", FormatTime(session.created));
  if (session.ended > 0) fields.emplace_back("ended", FormatTime(session.ended));
  if (session.report.has_value()) AppendReport(*session.report, &fields);
  PrintFields(fields);
  if (session.report.has_value()) PrintWindows(session.report->windows);
}

ExitCode WatchToTheEnd(const GlobalOptions& options, const Client& client, const std::string& map,
                       const std::string& id) {
  ProgressLine progress(options.json);
  const absl::StatusOr<SessionInfo> session = client.WatchSession(map, id, [&progress](const SessionInfo& now) {
    if (HasEnded(now.state)) return true;
    const bool in_stage = now.state == SessionInfo::State::kRunning && !now.stage.empty();
    progress.Show(in_stage ? now.stage : std::string(NameOf(now.state)), in_stage ? now.stage_progress : 0);
    return true;
  });
  progress.Clear();
  if (!session.ok()) return Fail(session.status());
  PrintSession(options, *session);
  if (session->state == SessionInfo::State::kCommitted) return ExitCode::kDone;
  PrintError(absl::StrFormat("session %s was not merged (%s): %s", id, NameOf(session->state), session->reason));
  return ExitCode::kFailed;
}

}  // namespace mapkeep
