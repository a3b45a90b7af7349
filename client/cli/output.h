#pragma once

#include <absl/status/status.h>

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "client/cli/command_line.h"

namespace mapkeep {

/// One line on the standard error: "mapkeep: MESSAGE".
void PrintError(const std::string& message);

/// Reports what the server or the system refused; bad input if it says that the request itself is wrong.
ExitCode Fail(const absl::Status& status);

/// Reports what is wrong with the user's files or arguments.
ExitCode BadInput(const absl::Status& status);

void PrintJson(const nlohmann::json& document);

/// Lines "NAME:  VALUE" with the values in one column.
void PrintFields(const std::vector<std::pair<std::string, std::string>>& fields);

/// Rows of cells in columns, the first row being the heading; numbers to the right, words to the left.
void PrintTable(const std::vector<std::vector<std::string>>& rows);

/// "2026-11-23 03:05" (UTC), or "-" for 0.
std::string FormatTime(double seconds_since_1970);

}  // namespace mapkeep
