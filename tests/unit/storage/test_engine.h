#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "storage/engine.h"
#include "storage/rocksdb_engine.h"

namespace mapkeep {

/// A directory of its own, removed at the end.
class TemporaryDirectory final {
 public:
  TemporaryDirectory() {
    std::string name = (std::filesystem::temp_directory_path() / "mapkeep-storage-XXXXXX").string();
    path_ = ::mkdtemp(name.data());
  }
  ~TemporaryDirectory() { std::filesystem::remove_all(path_); }
  TemporaryDirectory(const TemporaryDirectory&) = delete;
  TemporaryDirectory& operator=(const TemporaryDirectory&) = delete;

  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

/// A kind of engine to run the conformance tests on: opens what lies in a directory, or makes it.
struct EngineKind {
  std::string name;
  std::function<absl::StatusOr<std::unique_ptr<Engine>>(const std::string& directory)> open;
  bool has_checkpoints = true;
};

inline EngineKind RocksDbKind() {
  return {"RocksDb", [](const std::string& directory) { return OpenRocksDbEngine(directory); }};
}

/// An engine in a temporary directory that can be closed and opened again.
class TestEngine final {
 public:
  explicit TestEngine(EngineKind kind = RocksDbKind()) : kind_(std::move(kind)) { Reopen(); }

  void Reopen() {
    engine_.reset();
    absl::StatusOr<std::unique_ptr<Engine>> opened = kind_.open(directory_.path() + "/db");
    ASSERT_TRUE(opened.ok()) << opened.status();
    engine_ = *std::move(opened);
  }
  void Close() { engine_.reset(); }

  Engine& operator*() { return *engine_; }
  Engine* operator->() { return engine_.get(); }
  std::string path() const { return directory_.path() + "/db"; }
  const std::string& root() const { return directory_.path(); }

 private:
  EngineKind kind_;
  TemporaryDirectory directory_;
  std::unique_ptr<Engine> engine_;
};

}  // namespace mapkeep
