#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string>

#include "client/cli/arguments.h"
#include "client/cli/command_line.h"
#include "client/cli/output.h"
#include "client/cli/session_input.h"
#include "client/mapkeep/client.h"

namespace mapkeep {
namespace {

constexpr double kDegrees = 180 / std::numbers::pi;

struct LocalizeArguments {
  std::string map;
  SessionInput input;
  std::string initial_pose;  ///< empty: looked for all over the map
};

void Print(const GlobalOptions& options, const LocalizeAnswer& answer) {
  const PoseRows rows = RowsOf(answer.pose);
  const double yaw = std::atan2(answer.pose.linear()(1, 0), answer.pose.linear()(0, 0)) * kDegrees;
  const Eigen::Matrix<double, 6, 1> deviation = answer.covariance.diagonal().cwiseMax(0).cwiseSqrt();
  if (options.json) {
    nlohmann::json json = {{"found", answer.found}, {"epoch", answer.epoch}};
    if (answer.found) {
      json["pose"] = rows;
      json["fitness"] = answer.fitness;
      json["inliers"] = answer.inliers;
      json["covariance"] = std::vector<double>(answer.covariance.data(), answer.covariance.data() + 36);
    } else {
      json["reason"] = answer.reason;
    }
    PrintJson(json);
    return;
  }
  if (!answer.found) return;
  const Eigen::Vector3d place = answer.pose.translation();
  PrintFields({{"position", absl::StrFormat("%.3f %.3f %.3f m", place.x(), place.y(), place.z())},
               {"yaw", absl::StrFormat("%.3f degrees", yaw)},
               {"deviation", absl::StrFormat("%.3f %.3f %.3f m, %.3f degrees about z", deviation[0], deviation[1],
                                             deviation[2], deviation[5] * kDegrees)},
               {"fitness", absl::StrFormat("%.3f", answer.fitness)},
               {"inliers", absl::StrCat(answer.inliers)},
               {"epoch", absl::StrCat(answer.epoch)}});
}

ExitCode Localize(const GlobalOptions& options, const LocalizeArguments& arguments) {
  const absl::StatusOr<SessionDirectory> directory = OpenSessionInput(arguments.input);
  if (!directory.ok()) return BadInput(directory.status());
  LocalizeQuestion question{.map = arguments.map, .scans = SourceOf(*directory), .poses = directory->poses};
  if (!arguments.initial_pose.empty()) {
    const absl::StatusOr<KnownStart> start = ParseInitialPose("--initial-pose", arguments.initial_pose);
    if (!start.ok()) return BadInput(start.status());
    question.start = *start;
  }
  const absl::StatusOr<LocalizeAnswer> answer = options.Connect().Localize(question);
  if (!answer.ok()) return Fail(answer.status());
  Print(options, *answer);
  if (answer->found) return ExitCode::kDone;
  PrintError("not found in the map: " + answer->reason);
  return ExitCode::kFailed;
}

}  // namespace

void AddLocalizeCommand(CommandLine& line) {
  CLI::App* command = line.app.add_subcommand(
      "localize", "Where in a map a few scans (at most 64, see --frames) were taken: the pose of the last one");
  auto arguments = std::make_shared<LocalizeArguments>();
  command->add_option("MAP", arguments->map)->required()->check(NameValidator());
  AddSessionInput(*command, arguments->input);
  command->add_option("--initial-pose", arguments->initial_pose,
                      "X,Y,Z,YAW of the first scan in the map frame, roughly: metres and degrees");
  command->callback(
      [&line, arguments] { line.action = [&line, arguments] { return Localize(line.options, *arguments); }; });
}

}  // namespace mapkeep
