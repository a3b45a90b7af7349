#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "client/cli/removal_score.h"
#include "client/readers/session_directory.h"
#include "core/dor/remover.h"

namespace mapkeep {

/// A step of the ablation: removal with some of its refinements.
struct AblationStep {
  std::string name;
  DorParameters parameters;
};

/// The rows of the paper's Table 3 (voxel by voxel with the ground protected; + recovery; + bottom; + clusters), all
/// with the paper's plain count of exposures, then what goes past the paper, one thing at a time. The last step is the
/// default parameters.
std::vector<AblationStep> AblationSteps();

struct AblationRow {
  std::string name;
  RemovalScore score;
  double ms_per_scan = 0;  ///< wall clock: statistics, verdict and labels
};

/// Scores the labels of a session, one column a scan.
using LabelScorer = std::function<RemovalScore(std::span<const std::vector<PointLabel>> labels)>;

/// Told before each step; returns false to stop.
using AblationProgress = std::function<bool(const std::string& step, double fraction)>;

/// Cleans a session once a step. `scans` are read for every step, so they should be in memory. Runs on the calling
/// oneTBB arena. Errors as RemoveDynamicObjects.
absl::StatusOr<std::vector<AblationRow>> RunAblation(std::span<const Scan> scans, std::span<const Pose> poses,
                                                     std::span<const AblationStep> steps, const LabelScorer& scorer,
                                                     const AblationProgress& progress = {});

/// A session with its truth, held in memory.
struct LabelledSession {
  std::vector<Scan> scans;
  std::vector<Pose> poses;
  std::vector<std::vector<uint32_t>> truth;  ///< a class a point: 251 moving, 9 static, anything else is not scored
};

/// Reads the scans of a directory and its `label/NAME.label` (or `labels/`): uint32 a point of the file, the low half
/// its class. NOT_FOUND without labels, INVALID_ARGUMENT naming a label file whose length does not match its scan.
absl::StatusOr<LabelledSession> ReadLabelledSession(const SessionDirectory& directory);

/// As score_dor.py labels.
RemovalScore ScoreLabels(std::span<const std::vector<uint32_t>> truth, std::span<const std::vector<PointLabel>> labels);

}  // namespace mapkeep
