#include "storage/rocksdb_table_values.h"

#include <rocksdb/convenience.h>
#include <rocksdb/env.h>
#include <rocksdb/options.h>
#include <rocksdb/sst_file_writer.h>

#include <algorithm>

#include "storage/small_writes.h"
#include "storage/text.h"

namespace mapkeep {

rocksdb::ColumnFamilyOptions RocksDbTableValues::Options(const rocksdb::ColumnFamilyOptions& values) {
  rocksdb::ColumnFamilyOptions options = values;
  options.enable_blob_files = false;
  return options;
}

RocksDbTableValues::RocksDbTableValues(rocksdb::DB& db, rocksdb::ColumnFamilyHandle& family, std::string directory)
    : db_(db), family_(family), directory_(std::move(directory)), small_writes_(WithSmallWrites(*db.GetEnv())) {
  rocksdb::Env& env = *db_.GetEnv();
  std::vector<std::string> left;
  if (!env.GetChildren(directory_, &left).ok()) return;
  for (const std::string& file : left) env.DeleteFile(Text(directory_, "/", file)).PermitUncheckedError();
}

rocksdb::Status RocksDbTableValues::Put(std::vector<Entry> entries) {
  std::ranges::sort(entries, {}, &Entry::first);
  rocksdb::Env& env = *db_.GetEnv();
  if (rocksdb::Status made = env.CreateDirIfMissing(directory_); !made.ok()) return made;
  const std::string file = Text(directory_, "/", ++files_);
  rocksdb::Options options = db_.GetOptions(&family_);
  options.env = small_writes_.get();
  // Whoever runs the session reads the scans soon: they stay in the system's cache.
  rocksdb::SstFileWriter writer(rocksdb::EnvOptions(options), options, &family_, /*invalidate_page_cache=*/false);
  rocksdb::Status status = writer.Open(file);
  for (size_t i = 0; status.ok() && i < entries.size(); ++i) {
    status = writer.Put(entries[i].first, {entries[i].second.data(), entries[i].second.size()});
  }
  if (status.ok()) status = writer.Finish();  // synced
  if (status.ok()) {
    rocksdb::IngestExternalFileOptions ingestion;
    ingestion.move_files = true;
    ingestion.snapshot_consistency = false;  // there are no snapshots
    ingestion.write_global_seqno = false;
    status = db_.IngestExternalFile(&family_, {file}, ingestion);
  }
  if (!status.ok()) env.DeleteFile(file).PermitUncheckedError();
  return status;
}

rocksdb::Status RocksDbTableValues::Get(const std::string& key, std::string* value) const {
  rocksdb::ReadOptions options;
  options.fill_cache = false;  // one of them would displace the indices of many
  return db_.Get(options, &family_, key, value);
}

bool RocksDbTableValues::MayHold(const std::string& key) const {
  std::string value;
  return db_.KeyMayExist(rocksdb::ReadOptions(), &family_, key, &value);
}

bool RocksDbTableValues::MayHoldAny(std::span<const std::string> keys) const {
  return std::ranges::any_of(keys, [this](const std::string& key) { return MayHold(key); });
}

rocksdb::Status RocksDbTableValues::DeleteFiles(const std::string& first, const std::string& last) {
  const rocksdb::Slice begin(first), end(last);
  return rocksdb::DeleteFilesInRange(&db_, &family_, &begin, &end);
}

void RocksDbTableValues::Delete(std::span<const std::string> keys, rocksdb::WriteBatch& batch) const {
  for (const std::string& key : keys) {
    if (MayHold(key)) batch.Delete(&family_, key);
  }
}

}  // namespace mapkeep
