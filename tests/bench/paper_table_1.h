#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "core/registration/parameters.h"
#include "tests/bench/map_distance.h"

namespace mapkeep {

/// A row of Table 1: the second session aligned to the map of the first.
struct AlignmentRow {
  std::string method;
  bool aligned = false;
  std::string reason;  ///< why not
  MapDistance distance;
  double seconds = 0;  ///< wall clock: both sessions from scans to a map, the alignment included
};

/// Our rows for two sessions in directories of any layout that the client reads: scan poses from the pose graph, and
/// from the paper's fusion. Errors of the input name the file.
absl::StatusOr<std::vector<AlignmentRow>> RowsOfSessions(const std::filesystem::path& first,
                                                         const std::filesystem::path& second);

/// Table 1 as text, beside the paper's own figures.
std::string PrintedTable1(const std::string& name, std::span<const AlignmentRow> rows);

/// `paper_tables --sessions DIR DIR`: 0, or 1 and a message on the standard error.
int RunPaperTable1(std::span<const std::string> folders);

}  // namespace mapkeep
