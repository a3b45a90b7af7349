#include <absl/strings/str_format.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "client/archive/map_archive.h"
#include "client/cli/command_line.h"
#include "client/cli/interruption.h"
#include "client/cli/json_values.h"
#include "client/cli/output.h"
#include "client/cli/progress_line.h"

namespace mapkeep {
namespace {

struct ImportArguments {
  std::string map;
  std::string file;
};

ExitCode Import(const GlobalOptions& options, const ImportArguments& arguments) {
  absl::StatusOr<ArchiveReader> archive = ArchiveReader::Open(arguments.file);
  if (!archive.ok()) return BadInput(archive.status());
  const ArchiveHeader& header = archive->header();
  const Interruption interruption;
  ProgressLine line(options.json);
  absl::Status damage;
  const absl::StatusOr<MapInfo> map = options.Connect().ImportMap(
      {.name = arguments.map, .voxel_size = header.voxel_size, .origin = header.origin, .crs = header.crs},
      [&]() -> absl::StatusOr<std::vector<Block>> {
        if (interruption.requested()) return absl::CancelledError("stopped");
        line.Show("import", archive->fraction());
        absl::StatusOr<std::vector<Block>> blocks = archive->Next();
        damage = blocks.status();
        return blocks;
      });
  line.Clear();
  if (!damage.ok()) return BadInput(damage);
  if (!map.ok()) return Fail(map.status());
  if (options.json) {
    PrintJson(JsonOf(*map));
  } else {
    std::cout << absl::StrFormat("%s: %d voxels, of which %d static, from %s\n", map->name, map->voxels,
                                 map->static_voxels, arguments.file);
  }
  return ExitCode::kDone;
}

}  // namespace

void AddImportCommand(CommandLine& line) {
  CLI::App* command = line.app.add_subcommand("import", "Make a map from an archive that export has written");
  auto arguments = std::make_shared<ImportArguments>();
  command->add_option("MAP", arguments->map, "The new map")->required()->check(NameValidator());
  command->add_option("FILE", arguments->file, "Archive, .mkmap")->required();
  command->callback(
      [&line, arguments] { line.action = [&line, arguments] { return Import(line.options, *arguments); }; });
}

}  // namespace mapkeep
