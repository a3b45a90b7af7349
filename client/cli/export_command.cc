#include <absl/status/status.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

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
#include "client/cli/progress_line.h"
#include "client/exporters/map_points.h"
#include "client/exporters/point_file.h"
#include "client/mapkeep/client.h"

namespace mapkeep {
namespace {

struct ExportArguments {
  std::string map;
  std::string file;
  std::string box;  ///< empty: everything
  std::optional<uint64_t> epoch;
  bool all = false;
  bool centroids = false;
  bool absolute = false;
};

/// What a reader needs to place the points. Nothing about when or whence: equal maps give equal files.
std::vector<std::string> CommentsOf(const ExportArguments& arguments, const MapSnapshot& snapshot) {
  std::vector<std::string> comments = {absl::StrFormat("origin %.3f %.3f %.3f %s", snapshot.origin.x(),
                                                       snapshot.origin.y(), snapshot.origin.z(),
                                                       arguments.absolute ? "added" : "not added")};
  if (!snapshot.crs.empty()) comments.push_back(absl::StrCat("crs ", snapshot.crs));
  return comments;
}

ExitCode Export(const GlobalOptions& options, const ExportArguments& arguments) {
  const absl::StatusOr<PointFileFormat> format = PointFileFormatOf(arguments.file);
  if (!format.ok()) return BadInput(format.status());
  BlockQuery query{.map = arguments.map, .epoch = arguments.epoch, .box = {}, .include_all = arguments.all};
  if (!arguments.box.empty()) {
    absl::StatusOr<Eigen::AlignedBox3d> box = ParseBox("--box", arguments.box);
    if (!box.ok()) return BadInput(box.status());
    query.box = *box;
  }
  const PointDetail detail = arguments.centroids ? PointDetail::kCentroids : PointDetail::kSubVoxels;
  const CoordinateType coordinates = arguments.absolute ? CoordinateType::kFloat64 : CoordinateType::kFloat32;

  const Interruption interruption;
  MapSnapshot snapshot;
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  std::optional<PointFileWriter> writer;
  absl::Status status = options.Connect().StreamBlocks(
      query,
      [&](const MapSnapshot& header) -> absl::Status {
        snapshot = header;
        if (arguments.absolute) shift = header.origin;
        absl::StatusOr<PointFileWriter> created =
            PointFileWriter::Create(arguments.file, coordinates, CommentsOf(arguments, header));
        if (!created.ok()) return created.status();
        writer.emplace(*std::move(created));
        return absl::OkStatus();
      },
      [&](const Block& block) -> absl::Status {
        if (interruption.requested()) return absl::CancelledError("stopped");
        ForEachPoint(block, snapshot.voxel_size, detail, query.box,
                     [&](const Eigen::Vector3d& point, float intensity) { writer->Add(point + shift, intensity); });
        return absl::OkStatus();
      });
  if (status.ok()) status = writer->Finish();
  if (!status.ok()) return Fail(status);

  if (options.json) {
    PrintJson({{"map", arguments.map},
               {"epoch", snapshot.epoch},
               {"file", arguments.file},
               {"points", writer->count()},
               {"voxel_size", snapshot.voxel_size},
               {"origin", JsonOf(snapshot.origin)},
               {"crs", snapshot.crs}});
  } else {
    std::cout << absl::StrFormat("%s: %d points of %s at epoch %d\n", arguments.file, writer->count(), arguments.map,
                                 snapshot.epoch);
  }
  return ExitCode::kDone;
}

}  // namespace

void AddExportCommand(CommandLine& line) {
  CLI::App* command = line.app.add_subcommand("export", "Save a map's static points as a PCD or PLY file");
  auto arguments = std::make_shared<ExportArguments>();
  command->add_option("MAP", arguments->map)->required()->check(NameValidator());
  command->add_option("OUT", arguments->file, "File to write, .pcd or .ply")->required();
  command->add_option("--box", arguments->box, "Only what lies inside, metres relative to the map's origin")
      ->type_name("MINX,MINY,MINZ,MAXX,MAXY,MAXZ");
  command->add_option("--epoch", arguments->epoch, "An earlier state of the map; the newest by default");
  command->add_flag("--all", arguments->all, "Also what is not held to be static");
  command->add_flag("--centroids", arguments->centroids, "One point a voxel, its mean, instead of its sub-voxels");
  command->add_flag("--absolute", arguments->absolute, "Add the map's origin; coordinates become float64");
  command->callback(
      [&line, arguments] { line.action = [&line, arguments] { return Export(line.options, *arguments); }; });
}

}  // namespace mapkeep
