#pragma once

#include <string>
#include <vector>

namespace mapkeep {

/// What a finished process left.
struct ProgramResult {
  int exit_code = -1;
  std::string out;
  std::string error;
};

/// Runs the mapkeep program that was built, with these arguments and environment entries added, to its end.
ProgramResult RunMapkeep(const std::vector<std::string>& arguments, const std::vector<std::string>& environment = {});

}  // namespace mapkeep
