#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/strings/str_format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "client/cli/command_line.h"
#include "client/cli/interruption.h"
#include "client/cli/output.h"
#include "client/mapkeep/client.h"
#include "client/picture/colouring.h"
#include "client/picture/drawing.h"
#include "client/picture/top_view.h"

namespace mapkeep {
namespace {

constexpr double kUsualEdge = 1400;  // pixels of the longer edge when no scale is given
constexpr double kFinestScale = 20;  // one pixel a 5 cm sub-voxel
constexpr double kMostCells = 4e8;   // what a view may hold in memory: about 6 GB
constexpr double kMarginMetres = 1;

struct PictureArguments {
  std::string map;
  std::string file;
  PictureColour colour = PictureColour::kHeight;
  double scale = 0;  ///< pixels a metre; 0 is as the map's size asks
};

absl::StatusOr<TopView> ViewOf(const Client& client, const MapInfo& map, double scale) {
  if (!map.bounds) return absl::FailedPreconditionError(absl::StrFormat("map %s is empty", map.name));
  const Eigen::Vector2d low = map.bounds->min().head<2>(), high = map.bounds->max().head<2>();
  const Eigen::Vector2d cells = (high - low) * scale;
  if (cells.x() * cells.y() > kMostCells) {
    return absl::ResourceExhaustedError(
        absl::StrFormat("a picture of %.0f x %.0f m at %g pixels a metre is too large; ask for fewer",
                        high.x() - low.x(), high.y() - low.y(), scale));
  }
  TopView view = MakeTopView(low, high, 1 / scale);
  const Interruption interruption;
  const absl::Status streamed = client.StreamBlocks(
      {.map = map.name, .epoch = map.epoch}, [](const MapSnapshot&) { return absl::OkStatus(); },
      [&](const Block& block) -> absl::Status {
        if (interruption.requested()) return absl::CancelledError("stopped");
        AddBlock(block, map.voxel_size, view);
        return absl::OkStatus();
      });
  if (!streamed.ok()) return streamed;
  view = Cropped(view, static_cast<int>(kMarginMetres * scale));
  if (view.cells.empty()) return absl::FailedPreconditionError(absl::StrFormat("map %s has nothing static", map.name));
  return view;
}

ExitCode Picture(const GlobalOptions& options, const PictureArguments& arguments) {
  const Client client = options.Connect();
  const absl::StatusOr<MapInfo> map = client.GetMap(arguments.map);
  if (!map.ok()) return Fail(map.status());
  double scale = arguments.scale;
  if (scale == 0 && map->bounds) {
    scale = std::min(kFinestScale, kUsualEdge / map->bounds->sizes().head<2>().maxCoeff());
  }
  const absl::StatusOr<TopView> view = ViewOf(client, *map, scale);
  if (!view.ok()) return Fail(view.status());
  const std::string title = absl::StrFormat("%s, epoch %d", arguments.map, map->epoch);
  const absl::Status drawn = DrawPicture(*view, ColouringOf(*view, arguments.colour), title, arguments.file);
  if (!drawn.ok()) return Fail(drawn);
  if (options.json) {
    PrintJson({{"map", arguments.map},
               {"epoch", map->epoch},
               {"file", arguments.file},
               {"width_metres", view->width * view->cell_size},
               {"height_metres", view->height * view->cell_size},
               {"pixels_per_metre", scale}});
  } else {
    std::cout << absl::StrFormat("%s: %.0f x %.0f m of %s at epoch %d, %g pixels a metre\n", arguments.file,
                                 view->width * view->cell_size, view->height * view->cell_size, arguments.map,
                                 map->epoch, scale);
  }
  return ExitCode::kDone;
}

}  // namespace

void AddPictureCommand(CommandLine& line) {
  static const std::map<std::string, PictureColour> kColours = {{"height", PictureColour::kHeight},
                                                                {"stability", PictureColour::kStability},
                                                                {"ground", PictureColour::kGround},
                                                                {"age", PictureColour::kAge}};
  CLI::App* command = line.app.add_subcommand("picture", "Draw a map from above as a PNG file");
  auto arguments = std::make_shared<PictureArguments>();
  command->add_option("MAP", arguments->map)->required()->check(NameValidator());
  command->add_option("OUT", arguments->file, "File to write, .png")
      ->required()
      ->check(CLI::Validator([](const std::string& file) { return file.ends_with(".png") ? "" : "must end in .png"; },
                             "PNG"));
  command->add_option("--color", arguments->colour, "What the colours mean (default height)")
      ->transform(CLI::CheckedTransformer(kColours));
  command->add_option("--scale", arguments->scale, "Pixels a metre; by default as the map's size asks")
      ->check(CLI::Range(0.01, 1000.0));
  command->callback(
      [&line, arguments] { line.action = [&line, arguments] { return Picture(line.options, *arguments); }; });
}

}  // namespace mapkeep
