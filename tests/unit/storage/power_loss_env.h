#pragma once

#include <rocksdb/env.h>
#include <unistd.h>

#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <random>
#include <set>
#include <string>
#include <utility>

namespace mapkeep {

/// A file layer whose power fails after a number of writes: then what was not synced goes (the ends of files, and new
/// files whose directory was not), and with it this process, at once and with status 0, whatever it was at. (What is
/// renamed onto another file is taken to replace it: a journalling file system's promise.)
class PowerLossEnv final : public rocksdb::EnvWrapper {
 public:
  PowerLossEnv(int writes_left, uint64_t seed)
      : rocksdb::EnvWrapper(rocksdb::Env::Default()), random_(seed), writes_left_(writes_left) {}

  const char* Name() const override { return "PowerLossEnv"; }

  rocksdb::Status NewWritableFile(const std::string& name, std::unique_ptr<rocksdb::WritableFile>* file,
                                  const rocksdb::EnvOptions& options) override {
    Take();
    const bool is_new = !std::filesystem::exists(name);
    std::unique_ptr<rocksdb::WritableFile> opened;
    rocksdb::Status status = target()->NewWritableFile(name, &opened, options);
    if (!status.ok()) return status;
    const std::scoped_lock lock(mutex_);
    synced_[name] = 0;
    if (is_new) unlisted_.insert(name);
    *file = std::make_unique<File>(*this, name, std::move(opened));
    return status;
  }
  rocksdb::Status ReuseWritableFile(const std::string& name, const std::string& old,
                                    std::unique_ptr<rocksdb::WritableFile>* file,
                                    const rocksdb::EnvOptions& options) override {
    DeleteFile(old).PermitUncheckedError();
    return NewWritableFile(name, file, options);
  }
  rocksdb::Status NewDirectory(const std::string& name, std::unique_ptr<rocksdb::Directory>* directory) override {
    std::unique_ptr<rocksdb::Directory> opened;
    rocksdb::Status status = target()->NewDirectory(name, &opened);
    if (status.ok()) *directory = std::make_unique<Folder>(*this, name, std::move(opened));
    return status;
  }
  rocksdb::Status RenameFile(const std::string& from, const std::string& to) override {
    Take();
    const std::scoped_lock lock(mutex_);
    if (const auto found = synced_.extract(from); !found.empty()) synced_[to] = found.mapped();
    if (unlisted_.erase(from) > 0 && !std::filesystem::exists(to)) unlisted_.insert(to);
    return target()->RenameFile(from, to);
  }
  rocksdb::Status LinkFile(const std::string& from, const std::string& to) override {
    Take();
    const std::scoped_lock lock(mutex_);
    if (const auto found = synced_.find(from); found != synced_.end()) synced_[to] = found->second;
    unlisted_.insert(to);
    return target()->LinkFile(from, to);
  }
  rocksdb::Status DeleteFile(const std::string& name) override {
    Take();
    const std::scoped_lock lock(mutex_);
    synced_.erase(name);
    unlisted_.erase(name);
    return target()->DeleteFile(name);
  }

 private:
  class File final : public rocksdb::WritableFileWrapper {
   public:
    File(PowerLossEnv& env, std::string name, std::unique_ptr<rocksdb::WritableFile> file)
        : rocksdb::WritableFileWrapper(file.get()), env_(env), name_(std::move(name)), file_(std::move(file)) {}
    rocksdb::Status Append(const rocksdb::Slice& data) override {
      env_.Take();
      rocksdb::Status status = file_->Append(data);
      if (status.ok()) size_ += data.size();
      return status;
    }
    rocksdb::Status Append(const rocksdb::Slice& data, const rocksdb::DataVerificationInfo&) override {
      return Append(data);
    }
    rocksdb::Status Sync() override {
      env_.Take();
      return Synced(file_->Sync());
    }
    rocksdb::Status Fsync() override {
      env_.Take();
      return Synced(file_->Fsync());
    }

   private:
    rocksdb::Status Synced(rocksdb::Status status) {
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

  class Folder final : public rocksdb::Directory {
   public:
    Folder(PowerLossEnv& env, std::string name, std::unique_ptr<rocksdb::Directory> directory)
        : env_(env), name_(std::move(name)), directory_(std::move(directory)) {}
    rocksdb::Status Fsync() override {
      env_.Take();
      rocksdb::Status status = directory_->Fsync();
      if (!status.ok()) return status;
      const std::scoped_lock lock(env_.mutex_);
      std::erase_if(env_.unlisted_,
                    [this](const std::string& file) { return std::filesystem::path(file).parent_path() == name_; });
      return status;
    }
    rocksdb::Status Close() override { return directory_->Close(); }

   private:
    PowerLossEnv& env_;
    const std::filesystem::path name_;
    const std::unique_ptr<rocksdb::Directory> directory_;
  };

  void Take() {
    const std::scoped_lock lock(mutex_);
    if (--writes_left_ > 0) return;
    DropUnsynced();
    ::_exit(0);
  }

  /// Of what was not synced, all goes, or a random part of each file's end stays.
  void DropUnsynced() {
    const bool tear = random_() % 2 == 0;
    for (const auto& [name, size] : synced_) {
      std::error_code gone;
      const uint64_t written = std::filesystem::file_size(name, gone);
      if (gone || written <= size) continue;
      std::filesystem::resize_file(name, tear ? size + random_() % (written - size + 1) : size);
    }
    for (const std::string& name : unlisted_) {
      if (!tear || random_() % 2 == 0) std::filesystem::remove(name);
    }
  }

  std::mutex mutex_;
  std::mt19937_64 random_;
  int writes_left_;
  std::map<std::string, uint64_t> synced_;  ///< bytes of each file written here that are on the disk
  std::set<std::string> unlisted_;          ///< new files whose directory was not synced since
};

}  // namespace mapkeep
