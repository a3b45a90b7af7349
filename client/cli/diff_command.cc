#include <absl/strings/str_format.h>

#include <CLI/CLI.hpp>
#include <array>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "client/cli/command_line.h"
#include "client/cli/interruption.h"
#include "client/cli/json_values.h"
#include "client/cli/output.h"
#include "client/exporters/change_file.h"
#include "client/exporters/map_points.h"

namespace mapkeep {
namespace {

constexpr std::array<std::string_view, 3> kNames = {"appeared", "disappeared", "unstable"};  ///< by ChangeClass
constexpr size_t kMostRows = 20;  ///< of objects that are printed for people

struct DiffArguments {
  std::string map;
  uint64_t before = 0, after = 0;
  std::string file;
};

std::string_view NameOf(ChangeClass change) { return kNames[static_cast<size_t>(change)]; }

nlohmann::json JsonOf(const ChangedObject& object) {
  return {{"change", NameOf(object.change)},
          {"voxels", object.voxels},
          {"box",
           {{"min", mapkeep::JsonOf(Eigen::Vector3d(object.box.min()))},
            {"max", mapkeep::JsonOf(Eigen::Vector3d(object.box.max()))}}},
          {"centre", mapkeep::JsonOf(object.centre)}};
}

void PrintObjects(const ChangedObjectsInfo& found) {
  if (found.too_many) {
    std::cout << "too many voxels differ to group them to objects\n";
    return;
  }
  std::array<size_t, 3> counts{};
  for (const ChangedObject& object : found.objects) ++counts[static_cast<size_t>(object.change)];
  std::cout << absl::StrFormat("objects: %d appeared, %d disappeared, %d unstable\n", counts[0], counts[1], counts[2]);
  if (found.objects.empty()) return;
  std::vector<std::vector<std::string>> rows = {{"CHANGE", "X", "Y", "Z", "SIZE", "VOXELS"}};
  for (size_t i = 0; i < std::min(kMostRows, found.objects.size()); ++i) {
    const ChangedObject& object = found.objects[i];
    const Eigen::Vector3d size = object.box.sizes();
    rows.push_back({std::string(NameOf(object.change)), absl::StrFormat("%.1f", object.centre.x()),
                    absl::StrFormat("%.1f", object.centre.y()), absl::StrFormat("%.1f", object.centre.z()),
                    absl::StrFormat("%.1f x %.1f x %.1f m", size.x(), size.y(), size.z()),
                    absl::StrFormat("%d", object.voxels)});
  }
  PrintTable(rows);
  if (found.objects.size() > kMostRows) {
    std::cout << absl::StrFormat("and %d smaller ones: --json lists all\n", found.objects.size() - kMostRows);
  }
}

ExitCode Diff(const GlobalOptions& options, const DiffArguments& arguments) {
  std::optional<ChangeFileWriter> writer;
  MapSnapshot snapshot;
  std::array<uint64_t, 3> voxels{};
  uint64_t blocks = 0;
  const Interruption interruption;
  const auto add = [&](const std::optional<Block>& block, ChangeClass change) {
    if (!block) return;
    voxels[static_cast<size_t>(change)] += block->voxels.size();
    if (!writer) return;
    ForEachPoint(*block, snapshot.voxel_size, PointDetail::kSubVoxels, std::nullopt,
                 [&](const Eigen::Vector3d& point, const Voxel&) { writer->Add(point, change); });
  };
  const auto found = options.Connect().CompareEpochs(
      arguments.map, arguments.before, arguments.after,
      [&](const MapSnapshot& header) -> absl::Status {
        snapshot = header;
        if (arguments.file.empty()) return absl::OkStatus();
        auto created = ChangeFileWriter::Create(
            arguments.file, absl::StrFormat("%s from epoch %d to %d: green appeared, red disappeared, orange unstable",
                                            arguments.map, arguments.before, arguments.after));
        if (!created.ok()) return created.status();
        writer.emplace(*std::move(created));
        return absl::OkStatus();
      },
      [&](const BlockChangeInfo& change) -> absl::Status {
        if (interruption.requested()) return absl::CancelledError("stopped");
        ++blocks;
        add(change.appeared, ChangeClass::kAppeared);
        add(change.disappeared, ChangeClass::kDisappeared);
        add(change.unstable, ChangeClass::kUnstable);
        return absl::OkStatus();
      });
  if (!found.ok()) return Fail(found.status());
  if (writer) {
    if (const absl::Status status = writer->Finish(); !status.ok()) return Fail(status);
  }
  if (options.json) {
    nlohmann::json objects = nlohmann::json::array();
    for (const ChangedObject& object : found->objects) objects.push_back(JsonOf(object));
    PrintJson({{"map", arguments.map},
               {"before", arguments.before},
               {"after", arguments.after},
               {"appeared", voxels[0]},
               {"disappeared", voxels[1]},
               {"unstable", voxels[2]},
               {"blocks", blocks},
               {"objects", objects},
               {"too_many", found->too_many},
               {"points", writer ? writer->count() : 0}});
  } else {
    std::cout << absl::StrFormat(
        "%s from epoch %d to %d: %d static voxels appeared, %d disappeared, %d became unstable, in %d blocks\n",
        arguments.map, arguments.before, arguments.after, voxels[0], voxels[1], voxels[2], blocks);
    PrintObjects(*found);
  }
  return ExitCode::kDone;
}

}  // namespace

void AddDiffCommand(CommandLine& line, CLI::App& group) {
  auto arguments = std::make_shared<DiffArguments>();
  CLI::App* command =
      group.add_subcommand("diff", "Tell what static structure appeared, disappeared and became unstable");
  command->add_option("MAP", arguments->map)->required()->check(NameValidator());
  command->add_option("A", arguments->before, "Earlier epoch")->required();
  command->add_option("B", arguments->after, "Later epoch")->required();
  command->add_option("OUT", arguments->file,
                      "Coloured points, .ply: green appeared, red disappeared, orange unstable");
  command->callback(
      [&line, arguments] { line.action = [&line, arguments] { return Diff(line.options, *arguments); }; });
}

}  // namespace mapkeep
