#include <absl/status/status.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "client/cli/arguments.h"
#include "client/cli/command_line.h"
#include "client/cli/output.h"
#include "client/cli/progress_line.h"
#include "client/mapkeep/client.h"
#include "client/mapkeep/tile_folder.h"

namespace mapkeep {
namespace {

constexpr std::chrono::seconds kPause{5};  // between tries of a follower whose server is away for long

struct TileArguments {
  std::string map;
  std::string folder;
  std::string box;  ///< empty: everything
  std::optional<uint64_t> epoch;
  bool centroids = false;
  bool follow = false;
};

absl::StatusOr<TileQuery> QueryOf(const TileArguments& arguments) {
  TileQuery query{.map = arguments.map,
                  .epoch = arguments.epoch,
                  .area = {},
                  .detail = arguments.centroids ? TileDetail::kCentroids : TileDetail::kSubVoxels};
  if (!arguments.box.empty()) {
    absl::StatusOr<Eigen::AlignedBox3d> box = ParseBox("--box", arguments.box);
    if (!box.ok()) return box.status();
    query.area = *box;
  }
  return query;
}

ExitCode List(const GlobalOptions& options, const TileArguments& arguments) {
  const absl::StatusOr<TileQuery> query = QueryOf(arguments);
  if (!query.ok()) return BadInput(query.status());
  const absl::StatusOr<TileList> list = options.Connect().ListTiles(*query);
  if (!list.ok()) return Fail(list.status());
  nlohmann::json tiles = nlohmann::json::array();
  std::vector<std::vector<std::string>> rows = {{"X", "Y", "VOXELS", "BYTES", "VERSION"}};
  for (const TileInfo& tile : list->tiles) {
    tiles.push_back({{"x", tile.id.x},
                     {"y", tile.id.y},
                     {"version", tile.version},
                     {"bytes", tile.bytes},
                     {"voxels", tile.voxels}});
    rows.push_back({absl::StrCat(tile.id.x), absl::StrCat(tile.id.y), absl::StrCat(tile.voxels),
                    absl::StrCat(tile.bytes), tile.version});
  }
  if (options.json) {
    PrintJson({{"epoch", list->epoch}, {"tiles", tiles}});
  } else {
    std::cout << absl::StrFormat("epoch %d, %d tiles\n", list->epoch, list->tiles.size());
    PrintTable(rows);
  }
  return ExitCode::kDone;
}

void Print(const GlobalOptions& options, const TileArguments& arguments, const TileSyncResult& result) {
  if (options.json) {
    // A line each, so that a program can follow.
    std::cout << nlohmann::json({{"map", arguments.map},
                                 {"epoch", result.epoch},
                                 {"tiles", result.tiles},
                                 {"bytes", result.bytes},
                                 {"received", result.received},
                                 {"receivedBytes", result.received_bytes},
                                 {"dropped", result.dropped}})
                     .dump()
              << std::endl;
    return;
  }
  std::cout << absl::StrFormat("epoch %d: %d tiles, %.1f MB; received %d (%.1f MB), dropped %d", result.epoch,
                               result.tiles, 1e-6 * static_cast<double>(result.bytes), result.received,
                               1e-6 * static_cast<double>(result.received_bytes), result.dropped)
            << std::endl;
}

absl::Status SyncOnce(const GlobalOptions& options, const TileArguments& arguments, const Client& client,
                      const TileQuery& query) {
  ProgressLine line(options.json);
  const absl::StatusOr<TileSyncResult> result =
      SyncTileFolder(client, query, arguments.folder, [&line](const TileSyncProgress& at) {
        if (at.of_bytes > 0) line.Show("tiles", static_cast<double>(at.bytes) / static_cast<double>(at.of_bytes));
      });
  line.Clear();
  if (result.ok()) Print(options, arguments, *result);
  return result.status();
}

/// Until the process is killed, or something is wrong that does not pass.
absl::Status Follow(const GlobalOptions& options, const TileArguments& arguments, const Client& client,
                    const TileQuery& query) {
  std::string token;
  for (bool reached = false;;) {
    // The token first, the tiles after: no epoch can slip through between them.
    absl::StatusOr<std::string> next = client.WatchMap(arguments.map, token, [](const MapEvent&) { return false; });
    absl::Status status = next.status();
    if (next.ok()) {
      token = *std::move(next);
      status = SyncOnce(options, arguments, client, query);
    }
    if (status.ok()) {
      reached = true;
    } else if (!reached || !absl::IsUnavailable(status)) {
      return status;
    } else {
      PrintError(std::string(status.message()));
      token.clear();  // begins anew, in case the tiles did not come
      std::this_thread::sleep_for(kPause);
    }
  }
}

ExitCode Sync(const GlobalOptions& options, const TileArguments& arguments) {
  const absl::StatusOr<TileQuery> query = QueryOf(arguments);
  if (!query.ok()) return BadInput(query.status());
  const Client client = options.Connect();
  const absl::Status status =
      arguments.follow ? Follow(options, arguments, client, *query) : SyncOnce(options, arguments, client, *query);
  return status.ok() ? ExitCode::kDone : Fail(status);
}

CLI::App* AddCommand(CLI::App& group, const char* name, const char* description, TileArguments& arguments) {
  CLI::App* command = group.add_subcommand(name, description);
  command->add_option("MAP", arguments.map)->required()->check(NameValidator());
  command->add_option("--box", arguments.box, "Only tiles that it touches, seen from above; metres from the origin")
      ->type_name("MINX,MINY,MINZ,MAXX,MAXY,MAXZ");
  command->add_option("--epoch", arguments.epoch, "An earlier state of the map; the newest by default");
  command->add_flag("--centroids", arguments.centroids, "A mean point with its normal a voxel, without 5 cm points");
  return command;
}

}  // namespace

void AddTileCommands(CommandLine& line) {
  CLI::App* group = line.app.add_subcommand("tiles", "The static map as tiles, for robots");
  group->require_subcommand(1);

  auto listed = std::make_shared<TileArguments>();
  AddCommand(*group, "list", "Tiles with their sizes and versions", *listed)->callback([&line, listed] {
    line.action = [&line, listed] { return List(line.options, *listed); };
  });

  auto synced = std::make_shared<TileArguments>();
  CLI::App* sync =
      AddCommand(*group, "sync", "Bring a local folder to the map's state, a file a tile; safe to kill", *synced);
  sync->add_option("DIR", synced->folder, "Folder; made if need be")->required();
  CLI::Option* follow = sync->add_flag("--follow", synced->follow, "Go on with every new epoch");
  follow->excludes(sync->get_option("--epoch"));
  sync->callback([&line, synced] { line.action = [&line, synced] { return Sync(line.options, *synced); }; });
}

}  // namespace mapkeep
