#include <CLI/CLI.hpp>
#include <csignal>
#include <string>

#include "client/cli/command_line.h"
#include "client/cli/output.h"

namespace mapkeep {
namespace {

constexpr char kExamples[] = R"(Examples:
  mapkeep map create street
  mapkeep session upload street drive-0005 --wait
  mapkeep tiles sync street tiles --follow
  mapkeep export street street.pcd
  mapkeep query street 12.5 -3.0 0.4
  mapkeep localize street drive-0005 --frames 0:9
  mapkeep clean drive-0005 out          (no server needed)
  mapkeep simulate street               (no server needed)

Exit status: 0 done, 1 the operation failed, 2 usage or bad input.)";

int Run(int argc, char** argv) {
  CommandLine line;
  CLI::App& app = line.app;
  app.name("mapkeep");
  app.set_version_flag("--version", "mapkeep " MAPKEEP_VERSION);
  app.fallthrough();  // global options may also stand behind the command
  app.require_subcommand(1);
  AddConnectionOptions(line);
  app.add_flag("--json", line.options.json, "One JSON document on the standard output, for programs");
  AddMapCommands(line);
  AddAdminCommands(line);
  AddSessionCommands(line);
  AddTileCommands(line);
  AddExportCommand(line);
  AddImportCommand(line);
  AddQueryCommand(line);
  AddLocalizeCommand(line);
  AddCleanCommand(line);
  AddPictureCommand(line);
  AddSimulateCommand(line);
  app.footer(kExamples);  // last, for commands inherit what is set when they are added
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help, --version
    PrintError(std::string(error.what()) + " (see mapkeep --help)");
    return static_cast<int>(ExitCode::kUsage);
  }
  return static_cast<int>(line.action());
}

}  // namespace
}  // namespace mapkeep

int main(int argc, char** argv) {
  std::signal(SIGPIPE, SIG_IGN);  // a reader that left shows as a failed write
  return mapkeep::Run(argc, argv);
}
