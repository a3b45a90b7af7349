#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <string>

#include "storage/engine.h"

namespace mapkeep {

/// The embedded engine: one RocksDB in a directory, made if absent. Partition = key prefix; compare-and-set = a mutex a
/// partition and one synced WriteBatch, whose WAL also carries everything written before it. FAILED_PRECONDITION if
/// another process has it open.
absl::StatusOr<std::unique_ptr<Engine>> OpenRocksDbEngine(const std::string& directory);

}  // namespace mapkeep
