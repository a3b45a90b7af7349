#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <string>

#include "client/exporters/output_file.h"
#include "core/changes/changed_objects.h"

namespace mapkeep {

/// Writes points coloured by what became of them (appeared green, disappeared red, unstable orange) to a little-endian
/// PLY 1.0 file (float32 x y z, uchar red green blue) in constant memory; like PointFileWriter its header is written
/// twice in the same length. The file appears when Finish has succeeded.
class ChangeFileWriter {
 public:
  /// INVALID_ARGUMENT unless the name ends in .ply. `comment` goes into the header.
  static absl::StatusOr<ChangeFileWriter> Create(const std::filesystem::path& path, std::string comment);

  /// What goes wrong shows in Finish.
  void Add(const Eigen::Vector3d& point, ChangeClass change);

  uint64_t count() const { return count_; }

  absl::Status Finish();

 private:
  ChangeFileWriter(OutputFile file, std::string comment) : file_(std::move(file)), comment_(std::move(comment)) {}

  std::string Header() const;

  OutputFile file_;
  std::string comment_;
  uint64_t count_ = 0;
};

}  // namespace mapkeep
