#pragma once

#include <absl/status/statusor.h>

#include <CLI/CLI.hpp>
#include <string>

#include "client/readers/session_directory.h"

namespace mapkeep {

/// The arguments by which a command is given a session.
struct SessionInput {
  std::string directory;
  std::string format;  ///< empty: told by what is there
  SessionOptions options;
  std::string frames;  ///< empty: all
};

/// Adds DIR, --format, --frames and what chooses in recordings to a command.
void AddSessionInput(CLI::App& command, SessionInput& input);

/// Opens the directory as the arguments say. Every error is the user's (exit 2).
absl::StatusOr<SessionDirectory> OpenSessionInput(const SessionInput& input);

}  // namespace mapkeep
