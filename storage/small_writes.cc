#include "storage/small_writes.h"

#include <rocksdb/file_system.h>

#include <algorithm>
#include <cstddef>
#include <string>
#include <utility>

#include "storage/pause.h"

namespace mapkeep {
namespace {

constexpr size_t kPiece = size_t{64} << 10;  // bytes: some tens of microseconds

class SmallWritesFile final : public rocksdb::FSWritableFileOwnerWrapper {
 public:
  using FSWritableFileOwnerWrapper::FSWritableFileOwnerWrapper;

  rocksdb::IOStatus Append(const rocksdb::Slice& data, const rocksdb::IOOptions& options,
                           rocksdb::IODebugContext* debug) override {
    rocksdb::IOStatus status;
    for (size_t at = 0; status.ok() && at < data.size(); at += kPiece) {
      LetOthersRun();
      status = target()->Append({data.data() + at, std::min(kPiece, data.size() - at)}, options, debug);
    }
    return status;
  }
  // What is there to verify is of the whole.
  rocksdb::IOStatus Append(const rocksdb::Slice& data, const rocksdb::IOOptions& options,
                           const rocksdb::DataVerificationInfo& /*whole*/, rocksdb::IODebugContext* debug) override {
    return Append(data, options, debug);
  }
};

class SmallWrites final : public rocksdb::FileSystemWrapper {
 public:
  using FileSystemWrapper::FileSystemWrapper;

  const char* Name() const override { return "SmallWrites"; }

  rocksdb::IOStatus NewWritableFile(const std::string& name, const rocksdb::FileOptions& options,
                                    std::unique_ptr<rocksdb::FSWritableFile>* file,
                                    rocksdb::IODebugContext* debug) override {
    rocksdb::IOStatus status = target()->NewWritableFile(name, options, file, debug);
    if (status.ok()) *file = std::make_unique<SmallWritesFile>(std::move(*file));
    return status;
  }
};

}  // namespace

std::unique_ptr<rocksdb::Env> WithSmallWrites(rocksdb::Env& env) {
  return rocksdb::NewCompositeEnv(std::make_shared<SmallWrites>(env.GetFileSystem()));
}

}  // namespace mapkeep
