#include "storage/rocksdb_engine.h"

#include <gmock/gmock.h>
#include <rocksdb/env.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <random>

#include "tests/unit/storage/counting_map.h"
#include "tests/unit/storage/status_matchers.h"
#include "tests/unit/storage/test_engine.h"

namespace mapkeep {
namespace {

/// The machine's files on a disk that can be full.
class FullDiskEnv final : public rocksdb::EnvWrapper {
 public:
  FullDiskEnv() : EnvWrapper(rocksdb::Env::Default()) {}

  std::atomic<bool> full = false;
  std::atomic<bool> full_for_large_values = false;

  rocksdb::Status NewWritableFile(const std::string& name, std::unique_ptr<rocksdb::WritableFile>* file,
                                  const rocksdb::EnvOptions& options) override {
    std::unique_ptr<rocksdb::WritableFile> opened;
    const rocksdb::Status status = EnvWrapper::NewWritableFile(name, &opened, options);
    const bool is_large = name.find("/arriving/") != std::string::npos;
    if (status.ok()) *file = std::make_unique<File>(std::move(opened), is_large ? full_for_large_values : full);
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

TEST(RocksDbEngine, AMapIsReadOnAFullDiskAndCommittedToOnceThereIsSpace) {
  FullDiskEnv disk;
  const TemporaryDirectory directory;
  const auto engine = OpenRocksDbEngine(directory.path(), {.env = &disk});
  ASSERT_DONE(engine);
  {
    const auto maps = OpenMapStore(**engine, {});
    ASSERT_DONE(maps->Create({.name = "m"}));
    ASSERT_DONE(maps->Commit("m", CountingRequest(0)));
  }  // whose pins go with it
  disk.full = true;
  {
    const auto maps = OpenMapStore(**engine, {});
    ExpectCounted(*maps, {0});
    EXPECT_CODE(maps->Commit("m", CountingRequest(1)), kResourceExhausted);
    ExpectCounted(*maps, {0});
    disk.full = false;
    EXPECT_DONE(maps->Commit("m", CountingRequest(1)));
    ExpectCounted(*maps, {0, 1});
    EXPECT_THAT(maps->Verify("m")->problems, testing::IsEmpty());
  }
}

uint64_t BytesOfTables(const std::string& directory) {
  uint64_t bytes = 0;
  for (const auto& file : std::filesystem::directory_iterator(directory)) {
    if (file.path().extension() == ".sst") bytes += file.file_size();
  }
  return bytes;
}

TEST(RocksDbEngine, LargeValuesThatFindNoSpaceLeaveNothingBehindAndAreWrittenOnceThereIsSome) {
  FullDiskEnv disk;
  const TemporaryDirectory directory;
  const std::vector<ImmutableValue> values = {{"v", std::string(4 << 20, 'v')}};
  {
    const auto engine = OpenRocksDbEngine(directory.path(), {.env = &disk});
    ASSERT_DONE(engine);
    disk.full_for_large_values = true;
    EXPECT_CODE((*engine)->PutLargeValues("g", values), kResourceExhausted);
    EXPECT_TRUE(std::filesystem::is_empty(directory.path() + "/arriving"));
    EXPECT_CODE((*engine)->GetValue("g", "v"), kNotFound);
    EXPECT_DONE(Put(**engine, "a", "1")) << "what there is space for is written";
    disk.full_for_large_values = false;
    ASSERT_DONE((*engine)->PutLargeValues("g", values));
    EXPECT_EQ(*(*engine)->GetValue("g", "v"), values[0].value);
  }
  // What a process that was killed was writing goes when the store is opened.
  std::ofstream(directory.path() + "/arriving/7") << "half a table";
  const auto engine = OpenRocksDbEngine(directory.path());
  ASSERT_DONE(engine);
  EXPECT_TRUE(std::filesystem::is_empty(directory.path() + "/arriving"));
  EXPECT_EQ(*(*engine)->GetValue("g", "v"), values[0].value);
}

TEST(RocksDbEngine, TheSpaceOfLargeValuesIsGivenBackWhenTheyGo) {
  const TemporaryDirectory directory;
  const auto engine = OpenRocksDbEngine(directory.path());
  ASSERT_DONE(engine);
  for (const char* group : {"g", "h"}) {
    for (const char* key : {"a", "b", "c"}) {
      ASSERT_DONE((*engine)->PutLargeValues(group, std::vector<ImmutableValue>{{key, std::string(2 << 20, *key)}}));
    }
  }
  ASSERT_GT(BytesOfTables(directory.path()), 12U << 20);
  ASSERT_DONE((*engine)->DeleteValues("g", std::vector<std::string>{"a", "b", "c"}));
  EXPECT_LT(BytesOfTables(directory.path()), 7U << 20);
  EXPECT_EQ((*engine)->GetValue("h", "b")->size(), 2U << 20);
}

TEST(RocksDbEngine, ADamagedLargeValueIsDataLossAndTheOthersAreRead) {
  const TemporaryDirectory directory;
  const std::string copy = directory.path() + "/copy";
  const std::vector<ImmutableValue> values = {{"a", std::string(1 << 20, 'a')}, {"b", std::string(1 << 20, 'b')}};
  {
    const auto engine = OpenRocksDbEngine(directory.path() + "/db");
    ASSERT_DONE(engine);
    ASSERT_DONE((*engine)->PutLargeValues("g", values));
    ASSERT_DONE((*engine)->Checkpoint(copy));
  }
  for (const auto& file : std::filesystem::directory_iterator(copy)) {
    if (file.path().extension() != ".sst" || file.file_size() < (2U << 20)) continue;
    std::fstream bytes(file.path(), std::ios::in | std::ios::out | std::ios::binary);
    bytes.seekp((1 << 20) + (1 << 19));
    bytes.put('x');
  }
  const auto engine = OpenRocksDbEngine(copy);
  ASSERT_DONE(engine);
  EXPECT_EQ(*(*engine)->GetValue("g", "a"), values[0].value);
  EXPECT_CODE((*engine)->GetValue("g", "b"), kDataLoss);
}

TEST(RocksDbEngine, ItsMemoryIsToldAndKeepsToItsLimits) {
  constexpr size_t kLimit = size_t{4} << 20;
  const TemporaryDirectory directory;
  const auto engine =
      OpenRocksDbEngine(directory.path() + "/db", {.block_cache_bytes = kLimit, .write_buffer_bytes = kLimit});
  ASSERT_DONE(engine);
  uint64_t most_buffers = 0, most_cached = 0;
  for (int i = 0; i < 200; ++i) {
    std::vector<ImmutableValue> values;
    for (int v = 0; v < 50; ++v) values.push_back({std::to_string(100 * i + v), std::string(4000, 'v')});
    ASSERT_DONE((*engine)->PutValues("g", values));
    for (const ImmutableValue& value : values) ASSERT_DONE((*engine)->GetValue("g", value.key));
    const std::optional<RocksDbMemory> memory = MemoryOf(**engine);
    ASSERT_TRUE(memory);
    most_buffers = std::max(most_buffers, memory->write_buffers);
    most_cached = std::max(most_cached, memory->block_cache);
  }
  EXPECT_GT(most_buffers, kLimit / 4);
  EXPECT_LT(most_buffers, 8 * kLimit) << "40 MB were written";
  EXPECT_LT(most_cached, 2 * kLimit);
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
  const auto together = (*engine)->GetValues("g", std::vector<std::string>{"w", "v"});
  EXPECT_CODE(together[0], kNotFound);
  EXPECT_CODE(together[1], kDataLoss);
}

TEST(RocksDbEngine, ADamagedTableFileLosesWhatLiesThereAndTheRestIsReadAndListed) {
  constexpr int kValues = 400;
  const TemporaryDirectory directory;
  const std::string copy = directory.path() + "/copy";
  std::mt19937_64 random(1);
  std::vector<ImmutableValue> values;
  for (int i = 0; i < kValues; ++i) {
    std::string bytes(1000, '\0');  // too small for a blob file
    for (char& byte : bytes) byte = static_cast<char>(random());
    values.push_back({std::to_string(i), bytes});
  }
  {
    const auto engine = OpenRocksDbEngine(directory.path() + "/db");
    ASSERT_DONE(engine);
    ASSERT_DONE((*engine)->PutValues("g", values));
    ASSERT_DONE((*engine)->Checkpoint(copy));
  }
  std::filesystem::path largest;
  for (const auto& file : std::filesystem::directory_iterator(copy)) {
    const bool is_table = file.path().extension() == ".sst";
    if (is_table && (largest.empty() || file.file_size() > std::filesystem::file_size(largest))) largest = file.path();
  }
  ASSERT_GT(std::filesystem::file_size(largest), 300'000U);
  std::fstream bytes(largest, std::ios::in | std::ios::out | std::ios::binary);
  bytes.seekp(200'000);
  bytes.write("damaged", 7);
  bytes.close();

  const auto engine = OpenRocksDbEngine(copy);
  ASSERT_DONE(engine);
  int lost = 0;
  for (const ImmutableValue& value : values) {
    const auto read = (*engine)->GetValue("g", value.key);
    if (read.ok()) {
      EXPECT_EQ(*read, value.value);
      continue;
    }
    EXPECT_CODE(read, kDataLoss);
    ++lost;
  }
  EXPECT_GT(lost, 0);
  EXPECT_LT(lost, 20);
  int listed = 0;
  EXPECT_DONE((*engine)->ScanValueKeys("g", "", "", [&listed](std::string_view) { return ++listed > 0; }));
  EXPECT_EQ(listed, kValues);
  EXPECT_DONE(Put(**engine, "after", "1")) << "writes go on";
}

TEST(RocksDbEngine, ADamagedValueIsListedAllTheSame) {
  const TemporaryDirectory directory;
  const std::string copy = directory.path() + "/copy";
  const std::vector<ImmutableValue> values = {{"v", std::string(100000, 'v')}, {"w", std::string(100000, 'w')}};
  {
    const auto engine = OpenRocksDbEngine(directory.path() + "/db");
    ASSERT_DONE(engine);
    ASSERT_DONE((*engine)->PutValues("g", values));
    ASSERT_DONE((*engine)->Checkpoint(copy));
  }
  for (const auto& file : std::filesystem::directory_iterator(copy)) {
    if (file.path().extension() != ".blob") continue;
    std::fstream bytes(file.path(), std::ios::in | std::ios::out | std::ios::binary);
    bytes.seekp(50'000);
    bytes.put('x');
  }
  const auto engine = OpenRocksDbEngine(copy);
  ASSERT_DONE(engine);
  EXPECT_CODE((*engine)->GetValue("g", "v"), kDataLoss);
  EXPECT_DONE((*engine)->GetValue("g", "w"));
  std::vector<std::string> keys;
  EXPECT_DONE((*engine)->ScanValueKeys("g", "", "", [&keys](std::string_view key) {
    keys.emplace_back(key);
    return true;
  }));
  EXPECT_THAT(keys, testing::ElementsAre("v", "w"));
}

}  // namespace
}  // namespace mapkeep
