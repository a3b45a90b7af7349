#pragma once

#include <absl/status/statusor.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
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

/// Bytes that RocksDB holds in memory. The first three have limits: those of RocksDbOptions, and 1,024 open files.
struct RocksDbMemory {
  uint64_t write_buffers = 0;  ///< writes that are not in files yet, and those just written that are still read
  uint64_t block_cache = 0;    ///< blocks, indices and filters of files
  uint64_t table_readers = 0;  ///< what it knows of open files beside these, as it estimates
};

/// Of an engine that OpenRocksDbEngine gave; nothing of another kind.
std::optional<RocksDbMemory> MemoryOf(const Engine& engine);

}  // namespace mapkeep
