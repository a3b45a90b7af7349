#include "server/pipeline/session_scans.h"

#include <utility>

namespace mapkeep {
namespace {

size_t BytesOf(const StagedScan& scan) {
  return sizeof(StagedScan) + scan.scan.points.capacity() * sizeof(Eigen::Vector3f) +
         scan.scan.intensities.capacity() * sizeof(float);
}

}  // namespace

bool ScanMemory::Take(size_t bytes) {
  size_t used = used_;
  do {
    if (bytes > limit_ || used > limit_ - bytes) return false;
  } while (!used_.compare_exchange_weak(used, used + bytes));
  return true;
}

void ScanMemory::GiveBack(size_t bytes) { used_ -= bytes; }

SessionScans::SessionScans(const SessionStore& sessions, std::string map, std::string id, size_t count,
                           ScanMemory* memory)
    : sessions_(sessions), map_(std::move(map)), id_(std::move(id)), memory_(memory), kept_(count) {}

SessionScans::~SessionScans() {
  if (memory_ != nullptr) memory_->GiveBack(kept_bytes_);
}

absl::StatusOr<StagedScan> SessionScans::Read(size_t index) const {
  if (memory_ == nullptr) return sessions_.ReadScan(map_, id_, static_cast<uint32_t>(index));
  std::shared_ptr<const StagedScan> kept;
  {
    const std::lock_guard lock(mutex_);
    kept = kept_[index];
  }
  if (kept != nullptr) return *kept;
  absl::StatusOr<StagedScan> scan = sessions_.ReadScan(map_, id_, static_cast<uint32_t>(index));
  if (!scan.ok()) return scan;
  const size_t bytes = BytesOf(*scan);
  if (!memory_->Take(bytes)) return scan;
  kept = std::make_shared<const StagedScan>(*std::move(scan));
  {
    const std::lock_guard lock(mutex_);
    if (kept_[index] == nullptr) {
      kept_[index] = kept;
      kept_bytes_ += bytes;
    } else {
      memory_->GiveBack(bytes);  // somebody else was as quick
    }
  }
  return *kept;
}

}  // namespace mapkeep
