#pragma once

#include <CLI/CLI.hpp>

#include "client/cli/command_line.h"

namespace mapkeep {

/// Adds `upload` to the session group.
void AddUploadCommand(CommandLine& line, CLI::App& group);

}  // namespace mapkeep
