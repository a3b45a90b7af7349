#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <string>

#include "client/mapkeep/client.h"

namespace mapkeep {

/// What the process returns.
enum class ExitCode : int {
  kDone = 0,
  kFailed = 1,  ///< the operation failed
  kUsage = 2,   ///< usage or bad input
};

struct GlobalOptions {
  ClientOptions client;
  bool json = false;

  Client Connect() const { return Client(client); }
};

/// The program's command line. Command groups add their commands to `app`; a command that is given sets `action`, which
/// runs once everything has been parsed.
struct CommandLine {
  CLI::App app{"Keeps one clean static LiDAR map per site: sessions in, static map out."};
  GlobalOptions options;
  std::function<ExitCode()> action;
};

/// --server and what a connection needs: --tls-ca, --token and so on.
void AddConnectionOptions(CommandLine& line);

void AddAdminCommands(CommandLine& line);
void AddMapCommands(CommandLine& line);
/// Those of the map group that are about its epochs.
void AddHistoryCommands(CommandLine& line, CLI::App& group);
void AddDiffCommand(CommandLine& line, CLI::App& group);
void AddSessionCommands(CommandLine& line);
void AddTileCommands(CommandLine& line);
void AddExportCommand(CommandLine& line);
void AddImportCommand(CommandLine& line);
void AddQueryCommand(CommandLine& line);
void AddLocalizeCommand(CommandLine& line);
void AddCleanCommand(CommandLine& line);
void AddPictureCommand(CommandLine& line);
void AddSimulateCommand(CommandLine& line);

/// Accepts a map's or session's name: [A-Za-z0-9][A-Za-z0-9._:-]{0,127}.
CLI::Validator NameValidator();

}  // namespace mapkeep
