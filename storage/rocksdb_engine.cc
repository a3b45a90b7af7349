#include "storage/rocksdb_engine.h"

#include <absl/strings/escaping.h>
#include <absl/strings/match.h>
#include <rocksdb/cache.h>
#include <rocksdb/db.h>
#include <rocksdb/env.h>
#include <rocksdb/filter_policy.h>
#include <rocksdb/listener.h>
#include <rocksdb/options.h>
#include <rocksdb/table.h>
#include <rocksdb/utilities/checkpoint.h>
#include <rocksdb/write_batch.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <mutex>
#include <utility>
#include <vector>

#include "storage/rocksdb_table_values.h"
#include "storage/text.h"

namespace mapkeep {
namespace {

constexpr size_t kMaxNameLength = 1000;
constexpr size_t kMutexes = 64;
constexpr size_t kBatchBytes = size_t{8} << 20;
constexpr char kValueKeys[] = "value_keys";
constexpr char kLargeValues[] = "large_values";
constexpr char kListedKey[] = "value_keys_are_complete";  // in the default family

bool IsFull(const rocksdb::Status& status) {
  return status.IsNoSpace() || status.subcode() == rocksdb::Status::SubCode::kSpaceLimit;
}

absl::Status FromRocksDb(const rocksdb::Status& status, std::string_view what) {
  if (status.ok()) return absl::OkStatus();
  const std::string message = Text(what, ": ", status.ToString());
  if (IsFull(status)) return absl::ResourceExhaustedError(message);
  if (status.IsCorruption()) return absl::DataLossError(message);
  if (status.IsNotFound()) return absl::NotFoundError(message);
  if (status.IsInvalidArgument()) return absl::InvalidArgumentError(message);
  if (status.IsBusy() || status.IsTryAgain()) return absl::UnavailableError(message);
  return absl::InternalError(message);
}

/// Of a write: a log whose write or sync failed may still turn up with the record when it is opened again.
absl::Status FromFailedWrite(const rocksdb::Status& status, std::string_view what) {
  if (status.IsIOError() && !IsFull(status)) return absl::UnknownError(Text(what, ": ", status.ToString()));
  return FromRocksDb(status, what);
}

/// Key of a row: the length of its partition's name in two bytes, the name, the row's key. No name is a prefix of
/// another with its length before it, so no two rows collide and the rows of a partition are one contiguous range.
std::string PrefixOf(std::string_view partition) {
  std::string prefix;
  prefix.push_back(static_cast<char>(partition.size() >> 8));
  prefix.push_back(static_cast<char>(partition.size() & 0xff));
  prefix.append(partition);
  return prefix;
}

std::string KeyOf(std::string_view partition, std::string_view key) { return PrefixOf(partition).append(key); }

/// The first key after all that begin with `prefix`. The length bytes are never both 0xff 0xff with an all-0xff name of
/// that length in practice; if they were, an unbounded end is right.
std::string EndOfPrefix(std::string prefix) {
  while (!prefix.empty() && prefix.back() == '\xff') prefix.pop_back();
  if (!prefix.empty()) prefix.back() = static_cast<char>(static_cast<unsigned char>(prefix.back()) + 1);
  return prefix;
}

absl::Status CheckName(std::string_view name) {
  if (!name.empty() && name.size() <= kMaxNameLength) return absl::OkStatus();
  return absl::InvalidArgumentError(
      Text("the name of a partition or group has ", name.size(), " bytes, not 1 to ", kMaxNameLength));
}

std::string_view ViewOf(const rocksdb::Slice& slice) { return {slice.data(), slice.size()}; }

class RocksDbEngine final : public Engine {
 public:
  using Handles = std::vector<rocksdb::ColumnFamilyHandle*>;

  RocksDbEngine(std::unique_ptr<rocksdb::DB> db, const Handles& handles, const std::string& directory)
      : db_(std::move(db)),
        default_(handles[0]),
        rows_(handles[1]),
        values_(handles[2]),
        value_keys_(handles[3]),
        large_values_(handles[4]),
        large_(*db_, *large_values_, directory + "/arriving") {}

  ~RocksDbEngine() override {
    for (rocksdb::ColumnFamilyHandle* handle : {default_, rows_, values_, value_keys_, large_values_}) {
      db_->DestroyColumnFamilyHandle(handle);
    }
    db_->Close();
  }

  absl::StatusOr<std::optional<std::string>> Get(std::string_view partition, std::string_view key) const override {
    std::string value;
    const rocksdb::Status status = db_->Get({}, rows_, KeyOf(partition, key), &value);
    if (status.IsNotFound()) return std::nullopt;
    if (!status.ok()) return FromRocksDb(status, Describe("read", partition, key));
    return value;
  }

  absl::Status Scan(std::string_view partition, std::string_view begin, std::string_view end,
                    const std::function<bool(std::string_view, std::string_view)>& row) const override {
    return ScanFamily(rows_, partition, begin, end, row);
  }

  absl::Status Write(std::string_view partition, std::span<const Mutation> mutations, Durability durability) override {
    if (absl::Status status = CheckName(partition); !status.ok()) return status;
    const std::scoped_lock lock(MutexOf(partition));
    return Apply(BatchOf(partition, mutations), durability, Describe("write", partition, ""));
  }

  absl::Status CompareAndSet(std::string_view partition, std::span<const Condition> conditions,
                             std::span<const Mutation> mutations) override {
    return CompareAndSet(partition, conditions, mutations, Durability::kDurable);
  }

  absl::Status CompareAndSetBuffered(std::string_view partition, std::span<const Condition> conditions,
                                     std::span<const Mutation> mutations) override {
    return CompareAndSet(partition, conditions, mutations, Durability::kBuffered);
  }

  absl::Status PutValues(std::string_view group, std::span<const ImmutableValue> values) override {
    if (absl::Status status = CheckName(group); !status.ok()) return status;
    rocksdb::WriteBatch batch;
    Add(group, values, batch);
    return Apply(std::move(batch), Durability::kBuffered, Describe("write values", group, ""));
  }

  /// In few batches: one takes its turn in the log only once.
  absl::Status PutGroups(std::span<const ValueGroup> groups) override {
    rocksdb::WriteBatch batch;
    for (const ValueGroup& group : groups) {
      if (absl::Status status = CheckName(group.group); !status.ok()) return status;
      Add(group.group, group.values, batch);
      if (batch.GetDataSize() < kBatchBytes && &group != &groups.back()) continue;
      const absl::Status written =
          Apply(std::move(batch), Durability::kBuffered, Describe("write values", group.group, ""));
      if (!written.ok()) return written;
      batch = rocksdb::WriteBatch();
    }
    return absl::OkStatus();
  }

  /// As a file of their own. Their names are written before, so that no value is there that is not listed.
  absl::Status PutLargeValues(std::string_view group, std::span<const ImmutableValue> values) override {
    if (absl::Status status = CheckName(group); !status.ok()) return status;
    if (values.empty()) return absl::OkStatus();
    rocksdb::WriteBatch names;
    std::vector<RocksDbTableValues::Entry> entries;
    for (const ImmutableValue& value : values) {
      entries.emplace_back(KeyOf(group, value.key), value.value);
      names.Put(value_keys_, entries.back().first, {});
    }
    const std::string what = Describe("write large values", group, "");
    if (absl::Status status = Apply(std::move(names), Durability::kBuffered, what); !status.ok()) return status;
    return Note(large_.Put(std::move(entries)), what);
  }

  absl::StatusOr<std::string> GetValue(std::string_view group, std::string_view key) const override {
    std::string value;
    const std::string full = KeyOf(group, key);
    rocksdb::Status status = db_->Get({}, values_, full, &value);
    if (status.IsNotFound()) status = large_.Get(full, &value);
    if (!status.ok()) return FromRocksDb(status, Describe("read value", group, key));
    return value;
  }

  /// One look at the memory, the indices and the filters for all of them.
  std::vector<absl::StatusOr<std::string>> GetValues(std::string_view group,
                                                     std::span<const std::string> keys) const override {
    std::vector<std::string> full;
    full.reserve(keys.size());
    for (const std::string& key : keys) full.push_back(KeyOf(group, key));
    const std::vector<rocksdb::Slice> slices(full.begin(), full.end());
    std::vector<rocksdb::PinnableSlice> found(keys.size());
    std::vector<rocksdb::Status> statuses(keys.size());
    db_->MultiGet({}, values_, keys.size(), slices.data(), found.data(), statuses.data());
    std::vector<absl::StatusOr<std::string>> values;
    values.reserve(keys.size());
    for (size_t i = 0; i < keys.size(); ++i) {
      if (statuses[i].ok()) {
        values.emplace_back(found[i].ToString());
      } else if (statuses[i].IsNotFound()) {  // or it is a large one
        values.push_back(GetValue(group, keys[i]));
      } else {
        values.emplace_back(FromRocksDb(statuses[i], Describe("read value", group, keys[i])));
      }
    }
    return values;
  }

  absl::Status DeleteValues(std::string_view group, std::span<const std::string> keys) override {
    if (absl::Status status = CheckName(group); !status.ok()) return status;
    rocksdb::WriteBatch batch;
    std::vector<std::string> full;
    for (const std::string& key : keys) {
      full.push_back(KeyOf(group, key));
      batch.Delete(values_, full.back());
      batch.Delete(value_keys_, full.back());
    }
    const std::string what = Describe("delete values", group, "");
    if (large_.MayHoldAny(full)) {
      if (absl::Status status = DeleteLarge(group, std::move(full), batch); !status.ok()) return status;
    }
    return Apply(std::move(batch), Durability::kBuffered, what);
  }

  absl::Status ScanValueKeys(std::string_view group, std::string_view begin, std::string_view end,
                             const std::function<bool(std::string_view)>& row) const override {
    return ScanFamily(value_keys_, group, begin, end,
                      [&row](std::string_view key, std::string_view) { return row(key); });
  }

  absl::Status Sync() override { return FromRocksDb(db_->SyncWAL(), "sync"); }

  absl::Status Checkpoint(const std::string& directory) override {
    rocksdb::Checkpoint* made = nullptr;
    rocksdb::Status status = rocksdb::Checkpoint::Create(db_.get(), &made);
    const std::unique_ptr<rocksdb::Checkpoint> checkpoint(made);
    if (status.ok()) status = checkpoint->CreateCheckpoint(directory);
    return FromRocksDb(status, Text("checkpoint to ", directory));
  }

  RocksDbMemory Memory() const {
    RocksDbMemory memory;
    for (rocksdb::ColumnFamilyHandle* family : {default_, rows_, values_, value_keys_, large_values_}) {
      memory.write_buffers += Number(family, rocksdb::DB::Properties::kSizeAllMemTables);
      memory.table_readers += Number(family, rocksdb::DB::Properties::kEstimateTableReadersMem);
    }
    memory.block_cache = Number(rows_, rocksdb::DB::Properties::kBlockCacheUsage);  // one for all but `default_`
    return memory;
  }

  /// Lists the values of a directory that an older program made, which kept no list of them.
  absl::Status ListValues() {
    std::string listed;
    const rocksdb::Status found = db_->Get({}, default_, kListedKey, &listed);
    if (found.ok()) return absl::OkStatus();
    if (!found.IsNotFound()) return FromRocksDb(found, "look whether the values are listed");
    rocksdb::WriteBatch batch;
    const std::unique_ptr<rocksdb::Iterator> values(db_->NewIterator({}, values_));
    for (values->SeekToFirst(); values->Valid(); values->Next()) batch.Put(value_keys_, values->key(), {});
    if (!values->status().ok()) return FromRocksDb(values->status(), "list the values");
    batch.Put(default_, kListedKey, "");
    return Apply(std::move(batch), Durability::kDurable, "list the values");
  }

 private:
  uint64_t Number(rocksdb::ColumnFamilyHandle* family, const std::string& property) const {
    uint64_t number = 0;
    return db_->GetIntProperty(family, property, &number) ? number : 0;
  }

  absl::Status CompareAndSet(std::string_view partition, std::span<const Condition> conditions,
                             std::span<const Mutation> mutations, Durability durability) {
    if (absl::Status status = CheckName(partition); !status.ok()) return status;
    const std::scoped_lock lock(MutexOf(partition));
    for (const Condition& condition : conditions) {
      absl::StatusOr<std::optional<std::string>> found = Get(partition, condition.key);
      if (!found.ok()) return found.status();
      if (*found == condition.value) continue;
      const char* difference = !condition.value ? "exists" : *found ? "has changed" : "is absent";
      return absl::AbortedError(Text("row ", absl::Utf8SafeCEscape(condition.key), " of ",
                                     absl::Utf8SafeCEscape(ToAbsl(partition)), " ", difference));
    }
    return Apply(BatchOf(partition, mutations), durability, Describe("compare-and-set", partition, ""));
  }

  /// Whole files at once if the keys are all that the group has between the first and the last of them; the others by
  /// the batch.
  absl::Status DeleteLarge(std::string_view group, std::vector<std::string> keys, rocksdb::WriteBatch& batch) {
    std::ranges::sort(keys);
    const std::string prefix = PrefixOf(group);
    bool all = true;
    const absl::Status scanned = ScanFamily(value_keys_, group, std::string_view(keys.front()).substr(prefix.size()),
                                            "", [&](std::string_view key, std::string_view) {
                                              const std::string found = Text(prefix, key);
                                              if (found > keys.back()) return false;
                                              all = std::ranges::binary_search(keys, found);
                                              return all;
                                            });
    if (!scanned.ok()) return scanned;
    if (all) {
      const rocksdb::Status deleted = large_.DeleteFiles(keys.front(), keys.back());
      if (!deleted.ok()) return FromRocksDb(deleted, Describe("delete large values", group, ""));
    }
    large_.Delete(keys, batch);
    return absl::OkStatus();
  }

  void Add(std::string_view group, std::span<const ImmutableValue> values, rocksdb::WriteBatch& batch) const {
    for (const ImmutableValue& value : values) {
      const std::string key = KeyOf(group, value.key);
      batch.Put(values_, key, value.value);
      batch.Put(value_keys_, key, {});
    }
  }

  static std::string Describe(std::string_view action, std::string_view partition, std::string_view key) {
    return Text(action, " ", absl::Utf8SafeCEscape(ToAbsl(partition)), key.empty() ? "" : " ",
                absl::CHexEscape(ToAbsl(key)));
  }

  std::mutex& MutexOf(std::string_view partition) {
    return mutexes_[std::hash<std::string_view>()(partition) % kMutexes];
  }

  rocksdb::WriteBatch BatchOf(std::string_view partition, std::span<const Mutation> mutations) const {
    rocksdb::WriteBatch batch;
    for (const Mutation& mutation : mutations) {
      const std::string key = KeyOf(partition, mutation.key);
      if (mutation.value) {
        batch.Put(rows_, key, *mutation.value);
      } else {
        batch.Delete(rows_, key);
      }
    }
    return batch;
  }

  absl::Status Apply(rocksdb::WriteBatch batch, Durability durability, std::string_view what) {
    // A full disk stops RocksDB; once there is space again it must be told to go on.
    if (stopped_.load() && db_->Resume().ok()) stopped_ = false;
    rocksdb::WriteOptions options;
    options.sync = durability == Durability::kDurable;
    return Note(db_->Write(options, &batch), what);
  }

  absl::Status Note(const rocksdb::Status& written, std::string_view what) {
    if (written.ok()) return absl::OkStatus();
    if (IsFull(written)) stopped_ = true;
    return FromFailedWrite(written, what);
  }

  absl::Status ScanFamily(rocksdb::ColumnFamilyHandle* family, std::string_view partition, std::string_view begin,
                          std::string_view end,
                          const std::function<bool(std::string_view, std::string_view)>& row) const {
    const std::string prefix = PrefixOf(partition);
    const std::string last = end.empty() ? EndOfPrefix(prefix) : KeyOf(partition, end);
    const rocksdb::Slice bound(last);
    rocksdb::ReadOptions options;
    if (!last.empty()) options.iterate_upper_bound = &bound;
    const std::unique_ptr<rocksdb::Iterator> iterator(db_->NewIterator(options, family));
    for (iterator->Seek(KeyOf(partition, begin)); iterator->Valid(); iterator->Next()) {
      if (!row(ViewOf(iterator->key()).substr(prefix.size()), ViewOf(iterator->value()))) break;
    }
    return FromRocksDb(iterator->status(), Describe("scan", partition, begin));
  }

  const std::unique_ptr<rocksdb::DB> db_;
  rocksdb::ColumnFamilyHandle* const default_;
  rocksdb::ColumnFamilyHandle* const rows_;
  rocksdb::ColumnFamilyHandle* const values_;
  rocksdb::ColumnFamilyHandle* const value_keys_;  ///< of values_ and large ones: to list them without reading them
  rocksdb::ColumnFamilyHandle* const large_values_;
  RocksDbTableValues large_;
  std::array<std::mutex, kMutexes> mutexes_;  ///< partitions that share one only wait for each other
  std::atomic<bool> stopped_ = false;
};

/// RocksDB would look every five seconds whether a full disk has space again, and be busy with that; the next write
/// does.
class ResumeOnWrite final : public rocksdb::EventListener {
 public:
  void OnErrorRecoveryBegin(rocksdb::BackgroundErrorReason, rocksdb::Status, bool* automatic) override {
    *automatic = false;
  }
};

rocksdb::Options DatabaseOptions(const RocksDbOptions& options) {
  rocksdb::Options database;
  if (options.env != nullptr) database.env = options.env;
  database.listeners.push_back(std::make_shared<ResumeOnWrite>());
  database.create_if_missing = true;
  database.create_missing_column_families = true;
  database.db_write_buffer_size = options.write_buffer_bytes;
  database.max_total_wal_size = 4 * options.write_buffer_bytes;
  database.max_open_files = 1024;
  database.bytes_per_sync = uint64_t{1} << 20;
  // The log goes to the disk while it is written, so that a sync finds little left to wait for.
  database.wal_bytes_per_sync = uint64_t{1} << 20;
  database.keep_log_file_num = 4;
  database.max_log_file_size = size_t{8} << 20;
  database.info_log_level = rocksdb::WARN_LEVEL;
  return database;
}

std::vector<rocksdb::ColumnFamilyDescriptor> Families(const RocksDbOptions& options) {
  rocksdb::BlockBasedTableOptions table;
  table.block_cache = rocksdb::NewLRUCache(options.block_cache_bytes);
  table.filter_policy.reset(rocksdb::NewBloomFilterPolicy(10));
  table.cache_index_and_filter_blocks = true;

  rocksdb::ColumnFamilyOptions rows;
  rows.table_factory.reset(rocksdb::NewBlockBasedTableFactory(table));
  rows.compression = rocksdb::kZSTD;

  // Values are compressed already and never change, so compaction need not move them: they lie in blob files.
  rocksdb::ColumnFamilyOptions values;
  values.table_factory.reset(rocksdb::NewBlockBasedTableFactory(table));
  values.compression = rocksdb::kNoCompression;
  values.enable_blob_files = true;
  values.min_blob_size = 2048;
  values.blob_compression_type = rocksdb::kNoCompression;
  values.enable_blob_garbage_collection = true;
  values.blob_garbage_collection_age_cutoff = 0.5;
  values.blob_garbage_collection_force_threshold = 0.5;

  return {{rocksdb::kDefaultColumnFamilyName, {}},
          {"rows", rows},
          {"values", values},
          {kValueKeys, rows},
          {kLargeValues, RocksDbTableValues::Options(values)}};
}

}  // namespace

absl::StatusOr<std::unique_ptr<Engine>> OpenRocksDbEngine(const std::string& directory, const RocksDbOptions& options) {
  const rocksdb::Options database = DatabaseOptions(options);
  if (const rocksdb::Status made = database.env->CreateDirIfMissing(directory); !made.ok()) {
    return FromRocksDb(made, Text("make directory ", directory));
  }
  RocksDbEngine::Handles handles;
  rocksdb::DB* opened = nullptr;
  const rocksdb::Status status = rocksdb::DB::Open(database, directory, Families(options), &handles, &opened);
  if (status.ok()) {
    auto engine = std::make_unique<RocksDbEngine>(std::unique_ptr<rocksdb::DB>(opened), handles, directory);
    if (absl::Status listed = engine->ListValues(); !listed.ok()) return listed;
    return engine;
  }
  // RocksDB has no code of its own for this one.
  if (status.IsIOError() && absl::StrContains(status.ToString(), "lock ")) {
    return absl::FailedPreconditionError(
        Text(directory, " is open in another process (or twice in this one): ", status.ToString()));
  }
  return FromRocksDb(status, Text("open ", directory));
}

std::optional<RocksDbMemory> MemoryOf(const Engine& engine) {
  const auto* rocksdb_engine = dynamic_cast<const RocksDbEngine*>(&engine);
  return rocksdb_engine == nullptr ? std::nullopt : std::optional(rocksdb_engine->Memory());
}

}  // namespace mapkeep
