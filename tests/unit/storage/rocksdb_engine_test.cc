#include "storage/rocksdb_engine.h"

#include <gmock/gmock.h>
#include <rocksdb/env.h>

#include <atomic>
#include <filesystem>
#include <fstream>

#include "tests/unit/storage/status_matchers.h"
#include "tests/unit/storage/test_engine.h"

namespace mapkeep {
namespace {

/// The machine's files on a disk that can be full.
class FullDiskEnv final : public rocksdb::EnvWrapper {
 public:
  FullDiskEnv() : EnvWrapper(rocksdb::Env::Default()) {}

  std::atomic<bool> full = false;

  rocksdb::Status NewWritableFile(const std::string& name, std::unique_ptr<rocksdb::WritableFile>* file,
                                  const rocksdb::EnvOptions& options) override {
    std::unique_ptr<rocksdb::WritableFile> opened;
    const rocksdb::Status status = EnvWrapper::NewWritableFile(name, &opened, options);
    if (status.ok()) *file = std::make_unique<File>(std::move(opened), full);
    return status;
  }

 private:
  class File final : public rocksdb::WritableFileWrapper {
   public:
    File(std::unique_ptr<rocksdb::WritableFile> file, const std::atomic<bool>& full)
        : WritableFileWrapper(file.get()), file_(std::move(file)), full_(full) {}
    rocksdb::Status Append(const rocksdb::Slice& bytes) override {
      return full_ ? rocksdb::Status::NoSpace("the disk is full") : file_->Append(bytes);
    }
    rocksdb::Status Append(const rocksdb::Slice& bytes, const rocksdb::DataVerificationInfo&) override {
      return Append(bytes);
    }

   private:
    const std::unique_ptr<rocksdb::WritableFile> file_;
    const std::atomic<bool>& full_;
  };
};

absl::Status Put(Engine& engine, const std::string& key, const std::string& value) {
  const std::vector<Condition> absent = {{key, std::nullopt}};
  const std::vector<Mutation> row = {{key, value}};
  return engine.CompareAndSet("p", absent, row);
}

TEST(RocksDbEngine, ADirectoryIsOpenOnce) {
  const TemporaryDirectory directory;
  const auto first = OpenRocksDbEngine(directory.path());
  ASSERT_DONE(first);
  const absl::Status second = OpenRocksDbEngine(directory.path()).status();
  EXPECT_CODE(second, kFailedPrecondition);
  EXPECT_THAT(std::string(second.message()), testing::HasSubstr(directory.path()));
}

TEST(RocksDbEngine, AFullDiskRefusesWritesAndReadsGoOnAndThereIsRecovery) {
  FullDiskEnv disk;
  const TemporaryDirectory directory;
  const auto engine = OpenRocksDbEngine(directory.path(), {.env = &disk});
  ASSERT_DONE(engine);
  ASSERT_DONE(Put(**engine, "before", "1"));
  disk.full = true;
  EXPECT_CODE(Put(**engine, "full", "1"), kResourceExhausted);
  EXPECT_CODE(Put(**engine, "full", "1"), kResourceExhausted);
  EXPECT_EQ(**(*engine)->Get("p", "before"), "1");
  EXPECT_EQ(*(*engine)->Get("p", "full"), std::nullopt);
  disk.full = false;
  EXPECT_DONE(Put(**engine, "after", "1"));
  EXPECT_EQ(**(*engine)->Get("p", "after"), "1");
}

TEST(RocksDbEngine, ADamagedFileIsDataLoss) {
  const TemporaryDirectory directory;
  const std::string copy = directory.path() + "/copy";
  const std::vector<ImmutableValue> values = {{"v", std::string(100000, 'v')}};
  {
    const auto engine = OpenRocksDbEngine(directory.path() + "/db");
    ASSERT_DONE(engine);
    ASSERT_DONE((*engine)->PutValues("g", values));
    ASSERT_DONE((*engine)->Checkpoint(copy));  // writes what is in memory to files
  }
  int damaged = 0;
  for (const auto& file : std::filesystem::directory_iterator(copy)) {
    if (file.path().extension() != ".blob") continue;
    // The value lies in the middle of the file.
    std::fstream bytes(file.path(), std::ios::in | std::ios::out | std::ios::binary);
    bytes.seekp(static_cast<std::streamoff>(file.file_size() / 2));
    bytes.put('x');
    ++damaged;
  }
  ASSERT_EQ(damaged, 1);
  const auto engine = OpenRocksDbEngine(copy);
  ASSERT_DONE(engine);
  EXPECT_CODE((*engine)->GetValue("g", "v"), kDataLoss);
  EXPECT_CODE((*engine)->GetValue("g", "w"), kNotFound);
}

}  // namespace
}  // namespace mapkeep
