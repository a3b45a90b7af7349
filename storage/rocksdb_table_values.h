#pragma once

#include <rocksdb/db.h>
#include <rocksdb/env.h>
#include <rocksdb/status.h>
#include <rocksdb/write_batch.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace mapkeep {

/// Values of megabytes that come and go together (a session's staged scans), in a column family of their own: every
/// batch becomes a table file that is written once, by itself, and taken into the database as it is. They do not pass
/// through the log and the memory for writes, which would write them a second time; no compaction moves them, since no
/// two batches overlap; and a file whose values all go is unlinked whole. Thread-safe.
class RocksDbTableValues {
 public:
  /// A full key and its value.
  using Entry = std::pair<std::string, std::string_view>;

  /// Options of the family, given those that its tables share with the other families'.
  static rocksdb::ColumnFamilyOptions Options(const rocksdb::ColumnFamilyOptions& values);

  /// `db` and `family` outlive it. Files are made in `directory` before the database takes them in; what an earlier
  /// process left there goes.
  RocksDbTableValues(rocksdb::DB& db, rocksdb::ColumnFamilyHandle& family, std::string directory);

  /// Durable when it returns. The same value may be put again.
  rocksdb::Status Put(std::vector<Entry> entries);
  rocksdb::Status Get(const std::string& key, std::string* value) const;
  /// Whether any of the keys may be here; answers no without reading a file.
  bool MayHoldAny(std::span<const std::string> keys) const;
  /// Deletes everything from `first` to `last`, both included, that lies in files without anything else.
  rocksdb::Status DeleteFiles(const std::string& first, const std::string& last);
  /// Adds the deletion of those of the keys that are still here to a batch.
  void Delete(std::span<const std::string> keys, rocksdb::WriteBatch& batch) const;

 private:
  bool MayHold(const std::string& key) const;

  rocksdb::DB& db_;
  rocksdb::ColumnFamilyHandle& family_;
  const std::string directory_;
  const std::unique_ptr<rocksdb::Env> small_writes_;  // of table files
  std::atomic<uint64_t> files_ = 0;
};

}  // namespace mapkeep
