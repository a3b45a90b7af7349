#pragma once

#include <string>

#include "client/cli/command_line.h"
#include "client/mapkeep/client.h"

namespace mapkeep {

/// The session in full: "state: STATE" first, then the report.
void PrintSession(const GlobalOptions& options, const SessionInfo& session);

/// Follows a session with a progress line until it has ended, then prints it. kFailed unless it was committed.
ExitCode WatchToTheEnd(const GlobalOptions& options, const Client& client, const std::string& map,
                       const std::string& id);

}  // namespace mapkeep
