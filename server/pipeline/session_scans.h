#pragma once

#include <absl/status/statusor.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "core/geometry/scan.h"
#include "storage/session_store.h"

namespace mapkeep {

/// How many bytes of decoded scans all sessions at work may keep, together. Thread-safe.
class ScanMemory {
 public:
  explicit ScanMemory(size_t limit_bytes) : limit_(limit_bytes) {}

  /// Whether so many bytes more may be kept; they count until they are given back.
  bool Take(size_t bytes);
  void GiveBack(size_t bytes);
  size_t used() const { return used_; }

 private:
  const size_t limit_;
  std::atomic<size_t> used_ = 0;
};

/// The staged scans of one session, which every stage reads from the first to the last: those for which there is memory
/// are kept as they were decoded the first time, the others are read from the store each time. (Which ones stay does
/// not change meanwhile: of a session that is larger than the memory, dropping the one that was used longest ago would
/// always drop the one that is needed next.) Thread-safe.
class SessionScans {
 public:
  /// `sessions` and `memory` outlive it; nullptr: nothing is kept.
  SessionScans(const SessionStore& sessions, std::string map, std::string id, size_t count, ScanMemory* memory);
  ~SessionScans();
  SessionScans(const SessionScans&) = delete;
  SessionScans& operator=(const SessionScans&) = delete;

  size_t count() const { return kept_.size(); }

  /// Errors as of SessionStore::ReadScan.
  absl::StatusOr<StagedScan> Read(size_t index) const;

 private:
  const SessionStore& sessions_;
  const std::string map_, id_;
  ScanMemory* const memory_;
  mutable std::mutex mutex_;  // guards what follows
  mutable std::vector<std::shared_ptr<const StagedScan>> kept_;
  mutable size_t kept_bytes_ = 0;
};

}  // namespace mapkeep
