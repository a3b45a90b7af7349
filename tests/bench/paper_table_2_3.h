#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "client/cli/ablation.h"
#include "core/geometry/scan.h"

namespace mapkeep {

/// The KTH benchmark's metric: a true point counts as kept when a kept point lies within 0.05 m of it. `truth` has
/// intensity 1 for moving points and 0 for static ones; `kept` are points of the same frame.
RemovalScore ScoreByNearestKept(const Scan& truth, std::span<const Eigen::Vector3f> kept);

/// Our row of Table 2 and the rows of Table 3 for one folder.
struct KthTables {
  std::string name;  ///< the folder's
  size_t scans = 0;
  std::vector<AblationRow> ablation;  ///< of Table 3; the last row is our row of Table 2
};

/// Cleans a folder of the KTH dynamic-map benchmark (`pcd/`, `gt_cloud.pcd`) once a step of the ablation, and scores
/// what was kept. Errors of the input name the file.
absl::StatusOr<KthTables> TablesOfKthFolder(const std::filesystem::path& folder);

/// Both tables as text, beside the paper's own figures.
std::string PrintedTables(std::span<const KthTables> folders);

/// `paper_tables --kth DIR...`: 0, or 1 and a message on the standard error.
int RunPaperTables2And3(std::span<const std::string> folders);

}  // namespace mapkeep
