#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <variant>

#include "server/config.h"

namespace mapkeep {

/// Text to print before leaving with exit code 0 (--help, --version).
struct PrintAndLeave {
  std::string text;
};

/// The configuration of a command line: the defaults, then the file of --config, then the flags. INVALID_ARGUMENT
/// with place ("FILE:LINE" or the flag), value and what was expected.
absl::StatusOr<std::variant<Config, PrintAndLeave>> ReadCommandLine(int argc, const char* const* argv);

/// Applies a TOML text to `config`. INVALID_ARGUMENT with `file`, line and what was expected, for an unknown key or
/// table, a bad value or bad syntax; `config` may then be changed in part.
absl::Status ApplyToml(const std::string& text, const std::string& file, Config& config);

}  // namespace mapkeep
