#pragma once

#include <absl/status/statusor.h>

#include <string>

namespace mapkeep {

/// `mapkeepd token NAME --role ROLE... --map MAP... [--append FILE]`: makes a token and its line for the file of
/// --tokens; argv[0] is "token". Gives what to print: the token, which is kept nowhere else, and, unless it was
/// appended to FILE, the line. INVALID_ARGUMENT for bad usage, UNAVAILABLE if the file cannot be written.
absl::StatusOr<std::string> MakeToken(int argc, const char* const* argv);

}  // namespace mapkeep
