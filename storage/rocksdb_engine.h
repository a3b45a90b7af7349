#pragma once

#include <absl/status/statusor.h>

#include <cstddef>
#include <memory>
#include <string>

#include "storage/engine.h"

namespace rocksdb {
class Env;
}

namespace mapkeep {

struct RocksDbOptions {
  rocksdb::Env* env = nullptr;                   ///< files and threads; nullptr: the machine's own. Outlives the engine
  size_t block_cache_bytes = size_t{64} << 20;   ///< RocksDB's cache of index and data blocks
  size_t write_buffer_bytes = size_t{64} << 20;  ///< memory for writes that are not in table files yet, all together
};

/// The embedded engine: one RocksDB in a directory, made if absent. Partition = key prefix; compare-and-set = a mutex a
/// partition and one synced WriteBatch, whose WAL also carries everything written before it. FAILED_PRECONDITION if
/// another process has it open.
absl::StatusOr<std::unique_ptr<Engine>> OpenRocksDbEngine(const std::string& directory,
                                                          const RocksDbOptions& options = {});

}  // namespace mapkeep
