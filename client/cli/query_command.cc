#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "client/cli/command_line.h"
#include "client/cli/json_values.h"
#include "client/cli/output.h"
#include "client/mapkeep/client.h"

namespace mapkeep {
namespace {

struct QueryArguments {
  std::string map;
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
};

ExitCode Query(const GlobalOptions& options, const QueryArguments& arguments) {
  if (!arguments.point.allFinite()) return BadInput(absl::InvalidArgumentError("X, Y and Z must be finite"));
  const absl::StatusOr<VoxelInfo> voxel = options.Connect().QueryVoxel(arguments.map, arguments.point);
  if (!voxel.ok()) return Fail(voxel.status());
  if (options.json) {
    PrintJson(JsonOf(*voxel));
    return ExitCode::kDone;
  }
  PrintFields({{"H", absl::StrFormat("%.3f scans", voxel->hits)},
               {"E", absl::StrFormat("%.3f scans", voxel->exposures)},
               {"R", absl::StrFormat("%.4f", voxel->stability)},
               {"ground", voxel->ground ? "yes" : "no"},
               {"static", voxel->is_static ? "yes"
                          : voxel->is_new  ? "if a second session meets it"
                                           : "no"},
               {"first seen", FormatTime(voxel->first_seen)},
               {"last seen", FormatTime(voxel->last_seen)},
               {"mean", absl::StrFormat("%.3f %.3f %.3f", voxel->mean.x(), voxel->mean.y(), voxel->mean.z())},
               {"intensity", absl::StrFormat("%.3f", voxel->intensity)},
               {"epoch", absl::StrCat(voxel->epoch)}});
  return ExitCode::kDone;
}

}  // namespace

void AddQueryCommand(CommandLine& line) {
  CLI::App* command = line.app.add_subcommand("query", "What a map holds at one point");
  auto arguments = std::make_shared<QueryArguments>();
  command->add_option("MAP", arguments->map)->required()->check(NameValidator());
  command->add_option("X", arguments->point.x(), "Metres relative to the map's origin")->required();
  command->add_option("Y", arguments->point.y())->required();
  command->add_option("Z", arguments->point.z())->required();
  command->callback(
      [&line, arguments] { line.action = [&line, arguments] { return Query(line.options, *arguments); }; });
}

}  // namespace mapkeep
