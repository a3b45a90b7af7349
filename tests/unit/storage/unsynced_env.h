#pragma once

#include <rocksdb/env.h>

#include <memory>
#include <string>
#include <utility>

namespace mapkeep {

/// The machine's files, never synced: for tests that commit thousands of times and lose no power.
class UnsyncedEnv final : public rocksdb::EnvWrapper {
 public:
  UnsyncedEnv() : rocksdb::EnvWrapper(rocksdb::Env::Default()) {}

  const char* Name() const override { return "UnsyncedEnv"; }

  rocksdb::Status NewWritableFile(const std::string& name, std::unique_ptr<rocksdb::WritableFile>* file,
                                  const rocksdb::EnvOptions& options) override {
    std::unique_ptr<rocksdb::WritableFile> opened;
    rocksdb::Status status = target()->NewWritableFile(name, &opened, options);
    if (status.ok()) *file = std::make_unique<File>(std::move(opened));
    return status;
  }

 private:
  class File final : public rocksdb::WritableFileWrapper {
   public:
    explicit File(std::unique_ptr<rocksdb::WritableFile> file)
        : rocksdb::WritableFileWrapper(file.get()), file_(std::move(file)) {}
    rocksdb::Status Sync() override { return rocksdb::Status::OK(); }
    rocksdb::Status Fsync() override { return rocksdb::Status::OK(); }

   private:
    const std::unique_ptr<rocksdb::WritableFile> file_;
  };
};

}  // namespace mapkeep
