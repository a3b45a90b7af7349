#pragma once

#include <rocksdb/env.h>

#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

namespace mapkeep {

/// A file layer whose power fails after a number of writes: from then on every write is an error, and DropUnsynced
/// takes away what was not synced before. (Renamed and new files are taken to stay: a journalling file system's
/// promise.)
class PowerLossEnv final : public rocksdb::EnvWrapper {
 public:
  explicit PowerLossEnv(int writes_left) : rocksdb::EnvWrapper(rocksdb::Env::Default()), writes_left_(writes_left) {}

  const char* Name() const override { return "PowerLossEnv"; }

  rocksdb::Status NewWritableFile(const std::string& name, std::unique_ptr<rocksdb::WritableFile>* file,
                                  const rocksdb::EnvOptions& options) override {
    if (!Take()) return Off();
    std::unique_ptr<rocksdb::WritableFile> opened;
    rocksdb::Status status = target()->NewWritableFile(name, &opened, options);
    if (!status.ok()) return status;
    const std::scoped_lock lock(mutex_);
    synced_[name] = 0;
    *file = std::make_unique<File>(*this, name, std::move(opened));
    return status;
  }
  rocksdb::Status ReuseWritableFile(const std::string& name, const std::string& old,
                                    std::unique_ptr<rocksdb::WritableFile>* file,
                                    const rocksdb::EnvOptions& options) override {
    DeleteFile(old).PermitUncheckedError();
    return NewWritableFile(name, file, options);
  }
  rocksdb::Status RenameFile(const std::string& from, const std::string& to) override {
    if (!Take()) return Off();
    const std::scoped_lock lock(mutex_);
    if (const auto found = synced_.extract(from); !found.empty()) synced_[to] = found.mapped();
    return target()->RenameFile(from, to);
  }
  rocksdb::Status DeleteFile(const std::string& name) override {
    if (!Take()) return Off();
    const std::scoped_lock lock(mutex_);
    synced_.erase(name);
    return target()->DeleteFile(name);
  }

  bool has_failed() const {
    const std::scoped_lock lock(mutex_);
    return writes_left_ <= 0;
  }

  /// Once nobody has a file open.
  void DropUnsynced() {
    const std::scoped_lock lock(mutex_);
    for (const auto& [name, size] : synced_) {
      std::error_code gone;
      if (std::filesystem::file_size(name, gone) > size && !gone) std::filesystem::resize_file(name, size);
    }
  }

 private:
  class File final : public rocksdb::WritableFileWrapper {
   public:
    File(PowerLossEnv& env, std::string name, std::unique_ptr<rocksdb::WritableFile> file)
        : rocksdb::WritableFileWrapper(file.get()), env_(env), name_(std::move(name)), file_(std::move(file)) {}
    rocksdb::Status Append(const rocksdb::Slice& data) override {
      if (!env_.Take()) return Off();
      rocksdb::Status status = file_->Append(data);
      if (status.ok()) size_ += data.size();
      return status;
    }
    rocksdb::Status Append(const rocksdb::Slice& data, const rocksdb::DataVerificationInfo&) override {
      return Append(data);
    }
    rocksdb::Status Sync() override { return Synced(file_->Sync()); }
    rocksdb::Status Fsync() override { return Synced(file_->Fsync()); }

   private:
    rocksdb::Status Synced(rocksdb::Status status) {
      if (!env_.Take()) return Off();
      const std::scoped_lock lock(env_.mutex_);
      const auto found = env_.synced_.find(name_);
      if (status.ok() && found != env_.synced_.end()) found->second = size_;
      return status;
    }

    PowerLossEnv& env_;
    const std::string name_;
    const std::unique_ptr<rocksdb::WritableFile> file_;
    uint64_t size_ = 0;
  };

  static rocksdb::Status Off() { return rocksdb::Status::IOError("the power is off"); }
  bool Take() {
    const std::scoped_lock lock(mutex_);
    return --writes_left_ > 0;
  }

  mutable std::mutex mutex_;
  int writes_left_;
  std::map<std::string, uint64_t> synced_;  ///< bytes of each file written here that are on the disk
};

}  // namespace mapkeep
