#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "client/cli/arguments.h"
#include "client/cli/command_line.h"
#include "client/cli/json_values.h"
#include "client/cli/output.h"

namespace mapkeep {
namespace {

constexpr double kSmallestVoxel = 0.05;  // metres
constexpr double kLargestVoxel = 1.0;

struct CreateArguments {
  NewMap map;
  std::string origin;  ///< empty: not given
};

std::string Text(const Eigen::Vector3d& point) {
  return absl::StrFormat("%.3f %.3f %.3f", point.x(), point.y(), point.z());
}

void PrintMap(const MapInfo& map) {
  std::vector<std::pair<std::string, std::string>> fields = {
      {"name", map.name},
      {"epoch", absl::StrCat(map.epoch)},
      {"sessions", absl::StrCat(map.sessions)},
      {"voxels", absl::StrFormat("%d, of which %d static", map.voxels, map.static_voxels)},
      {"voxel size", absl::StrFormat("%g m", map.voxel_size)},
      {"blocks", absl::StrFormat("%d in %d tiles", map.blocks, map.tiles)},
      {"origin", map.origin.has_value() ? Text(*map.origin) : "not set yet"},
      {"crs", map.crs.empty() ? "-" : map.crs},
      {"created", FormatTime(map.created)},
  };
  if (map.bounds.has_value()) {
    fields.emplace_back("bounds", absl::StrCat(Text(map.bounds->min()), " to ", Text(map.bounds->max())));
  }
  PrintFields(fields);
}

ExitCode Create(const GlobalOptions& options, CreateArguments arguments) {
  if (!(arguments.map.voxel_size >= kSmallestVoxel && arguments.map.voxel_size <= kLargestVoxel)) {
    return BadInput(absl::InvalidArgumentError(absl::StrFormat(
        "--voxel-size %g: expected %g to %g metres", arguments.map.voxel_size, kSmallestVoxel, kLargestVoxel)));
  }
  if (!arguments.origin.empty()) {
    absl::StatusOr<Eigen::Vector3d> origin = ParsePoint("--origin", arguments.origin);
    if (!origin.ok()) return BadInput(origin.status());
    arguments.map.origin = *origin;
  }
  const absl::StatusOr<MapInfo> map = options.Connect().CreateMap(arguments.map);
  if (!map.ok()) return Fail(map.status());
  if (options.json) {
    PrintJson(JsonOf(*map));
  } else {
    std::cout << "created map " << map->name << '\n';
  }
  return ExitCode::kDone;
}

ExitCode List(const GlobalOptions& options) {
  const absl::StatusOr<std::vector<MapInfo>> maps = options.Connect().ListMaps();
  if (!maps.ok()) return Fail(maps.status());
  if (options.json) {
    nlohmann::json list = nlohmann::json::array();
    for (const MapInfo& map : *maps) list.push_back(JsonOf(map));
    PrintJson({{"maps", list}});
    return ExitCode::kDone;
  }
  std::vector<std::vector<std::string>> rows = {{"NAME", "EPOCH", "SESSIONS", "VOXELS", "STATIC", "CREATED"}};
  for (const MapInfo& map : *maps) {
    rows.push_back({map.name, absl::StrCat(map.epoch), absl::StrCat(map.sessions), absl::StrCat(map.voxels),
                    absl::StrCat(map.static_voxels), FormatTime(map.created)});
  }
  PrintTable(rows);
  return ExitCode::kDone;
}

ExitCode Info(const GlobalOptions& options, const std::string& name) {
  const absl::StatusOr<MapInfo> map = options.Connect().GetMap(name);
  if (!map.ok()) return Fail(map.status());
  if (options.json) {
    PrintJson(JsonOf(*map));
  } else {
    PrintMap(*map);
  }
  return ExitCode::kDone;
}

ExitCode Delete(const GlobalOptions& options, const std::string& name) {
  const absl::Status deleted = options.Connect().DeleteMap(name);
  if (!deleted.ok()) return Fail(deleted);
  if (options.json) {
    PrintJson({{"deleted", name}});
  } else {
    std::cout << "deleted map " << name << '\n';
  }
  return ExitCode::kDone;
}

}  // namespace

void AddMapCommands(CommandLine& line) {
  CLI::App* group = line.app.add_subcommand("map", "Make, list, describe and delete maps");
  group->require_subcommand(1);

  CLI::App* create = group->add_subcommand("create", "Make an empty map");
  auto arguments = std::make_shared<CreateArguments>();
  create->add_option("NAME", arguments->map.name)->required()->check(NameValidator());
  create->add_option("--voxel-size", arguments->map.voxel_size, "Edge of a voxel, metres, 0.05 to 1")
      ->type_name("METRES")
      ->capture_default_str();
  create
      ->add_option("--origin", arguments->origin,
                   "Where the map's coordinates begin, metres; by default a first session that starts more than 10 km "
                   "from zero sets it")
      ->type_name("X,Y,Z");
  create->add_option("--crs", arguments->map.crs, "Coordinate reference system of the origin")->type_name("EPSG:N");
  create->callback(
      [&line, arguments] { line.action = [&line, arguments] { return Create(line.options, *arguments); }; });

  CLI::App* list = group->add_subcommand("list", "List the maps");
  list->callback([&line] { line.action = [&line] { return List(line.options); }; });

  auto name = std::make_shared<std::string>();
  CLI::App* info = group->add_subcommand("info", "Describe a map");
  info->add_option("NAME", *name)->required()->check(NameValidator());
  info->callback([&line, name] { line.action = [&line, name] { return Info(line.options, *name); }; });

  CLI::App* remove = group->add_subcommand("delete", "Delete a map with its sessions");
  remove->add_option("NAME", *name)->required()->check(NameValidator());
  remove->callback([&line, name] { line.action = [&line, name] { return Delete(line.options, *name); }; });

  AddHistoryCommands(line, *group);
}

}  // namespace mapkeep
