#include "storage/small_writes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rocksdb/env.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace mapkeep {
namespace {

using ::testing::Each;
using ::testing::Le;
using ::testing::SizeIs;

// Notes how large every write is.
class WatchedEnv final : public rocksdb::EnvWrapper {
 public:
  WatchedEnv() : EnvWrapper(rocksdb::Env::Default()) {}

  rocksdb::Status NewWritableFile(const std::string& name, std::unique_ptr<rocksdb::WritableFile>* file,
                                  const rocksdb::EnvOptions& options) override {
    rocksdb::Status status = target()->NewWritableFile(name, file, options);
    if (status.ok()) *file = std::make_unique<File>(*this, std::move(*file));
    return status;
  }

  std::vector<size_t> sizes;

 private:
  class File final : public rocksdb::WritableFileWrapper {
   public:
    File(WatchedEnv& env, std::unique_ptr<rocksdb::WritableFile> file)
        : WritableFileWrapper(file.get()), env_(env), file_(std::move(file)) {}
    rocksdb::Status Append(const rocksdb::Slice& data) override {
      env_.sizes.push_back(data.size());
      return file_->Append(data);
    }

   private:
    WatchedEnv& env_;
    const std::unique_ptr<rocksdb::WritableFile> file_;
  };
};

TEST(SmallWrites, WriteTheSameInPieces) {
  WatchedEnv watched;
  const std::unique_ptr<rocksdb::Env> env = WithSmallWrites(watched);
  const std::string name = ::testing::TempDir() + "/small_writes_test";
  std::string bytes(1'000'001, '\0');
  for (size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<char>(i * i >> 3);

  std::unique_ptr<rocksdb::WritableFile> file;
  ASSERT_TRUE(env->NewWritableFile(name, &file, rocksdb::EnvOptions()).ok());
  ASSERT_TRUE(file->Append(bytes).ok());
  ASSERT_TRUE(file->Append("").ok());
  ASSERT_TRUE(file->Sync().ok());
  ASSERT_TRUE(file->Close().ok());

  std::string written;
  ASSERT_TRUE(rocksdb::ReadFileToString(rocksdb::Env::Default(), name, &written).ok());
  EXPECT_EQ(written, bytes);
  EXPECT_THAT(watched.sizes, SizeIs(16));
  EXPECT_THAT(watched.sizes, Each(Le(size_t{64} << 10)));
  std::filesystem::remove(name);
}

}  // namespace
}  // namespace mapkeep
