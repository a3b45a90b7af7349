#include <absl/status/status.h>
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
#include "client/cli/interruption.h"
#include "client/cli/json_values.h"
#include "client/cli/output.h"
#include "client/exporters/map_exporter.h"
#include "client/mapkeep/client.h"

namespace mapkeep {
namespace {

struct ExportArguments {
  std::string map;
  std::string file;
  std::string format;  ///< empty: told by the suffix
  std::string box;     ///< empty: everything
  std::optional<uint64_t> epoch;
  bool all = false;
  bool centroids = false;
  bool absolute = false;
  bool compressed = false;
};

/// What the formats are called, for the help text.
std::string FormatList() {
  return absl::StrJoin(ExportFormats(), "; ", [](std::string* out, const ExportFormatInfo& info) {
    absl::StrAppend(out, std::string(info.name), ": ", std::string(info.what));
  });
}

ExitCode Export(const GlobalOptions& options, const ExportArguments& arguments) {
  const absl::StatusOr<ExportFormat> format = ExportFormatOf(arguments.file, arguments.format);
  if (!format.ok()) return BadInput(format.status());
  const ExportFormatInfo& info = InfoOf(*format);
  BlockQuery query{.map = arguments.map, .epoch = arguments.epoch, .box = {}, .include_all = arguments.all};
  if (info.whole_voxels) {
    if (arguments.centroids || !arguments.box.empty()) {
      return BadInput(absl::InvalidArgumentError(
          absl::StrCat(std::string(info.name), " holds a whole map: --box and --centroids are not for it")));
    }
    query.include_all = true;
  }
  if (!arguments.box.empty()) {
    absl::StatusOr<Eigen::AlignedBox3d> box = ParseBox("--box", arguments.box);
    if (!box.ok()) return BadInput(box.status());
    query.box = *box;
  }
  const ExportOptions export_options{.detail = arguments.centroids ? PointDetail::kCentroids : PointDetail::kSubVoxels,
                                     .box = query.box,
                                     .absolute = arguments.absolute,
                                     .compressed = arguments.compressed};

  const Interruption interruption;
  MapSnapshot snapshot;
  std::unique_ptr<MapExporter> exporter;
  absl::Status status = options.Connect().StreamBlocks(
      query,
      [&](const MapSnapshot& header) -> absl::Status {
        snapshot = header;
        auto opened =
            OpenExporter(*format, arguments.file,
                         {.voxel_size = header.voxel_size, .origin = header.origin, .crs = header.crs}, export_options);
        if (!opened.ok()) return opened.status();
        exporter = *std::move(opened);
        return absl::OkStatus();
      },
      [&](const Block& block) -> absl::Status {
        if (interruption.requested()) return absl::CancelledError("stopped");
        return exporter->Add(block);
      });
  if (status.ok()) status = exporter->Finish();
  if (!status.ok()) return Fail(status);

  const char* counted = info.whole_voxels ? "voxels" : "points";
  if (options.json) {
    PrintJson({{"map", arguments.map},
               {"epoch", snapshot.epoch},
               {"file", arguments.file},
               {"format", std::string(info.name)},
               {counted, exporter->count()},
               {"voxel_size", snapshot.voxel_size},
               {"origin", JsonOf(snapshot.origin.value_or(Eigen::Vector3d::Zero()))},
               {"crs", snapshot.crs}});
  } else {
    std::cout << absl::StrFormat("%s: %d %s of %s at epoch %d\n", arguments.file, exporter->count(), counted,
                                 arguments.map, snapshot.epoch);
  }
  return ExitCode::kDone;
}

}  // namespace

void AddExportCommand(CommandLine& line) {
  CLI::App* command = line.app.add_subcommand("export", "Save a map in a format that other tools read");
  auto arguments = std::make_shared<ExportArguments>();
  command->add_option("MAP", arguments->map)->required()->check(NameValidator());
  command->add_option("OUT", arguments->file, "File or directory to write; its suffix tells the format")->required();
  command->add_option("--format", arguments->format, FormatList())->type_name("NAME");
  command->add_option("--box", arguments->box, "Only what lies inside, metres relative to the map's origin")
      ->type_name("MINX,MINY,MINZ,MAXX,MAXY,MAXZ");
  command->add_option("--epoch", arguments->epoch, "An earlier state of the map; the newest by default");
  command->add_flag("--all", arguments->all, "Also what is not held to be static");
  command->add_flag("--centroids", arguments->centroids, "One point a voxel, its mean, instead of its sub-voxels");
  command->add_flag("--absolute", arguments->absolute, "Add the map's origin; coordinates become float64");
  command->add_flag("--compressed", arguments->compressed, "PCD: binary_compressed");
  command->callback(
      [&line, arguments] { line.action = [&line, arguments] { return Export(line.options, *arguments); }; });
}

}  // namespace mapkeep
