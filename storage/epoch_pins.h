#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <condition_variable>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>

#include "storage/clock.h"
#include "storage/engine.h"
#include "storage/map_rows.h"

namespace mapkeep {

/// Keeps the collector away from the epochs that this process reads: one leased row a map, with the lowest of them,
/// renewed in the background. Opening an epoch that the row covers already costs no write. Thread-safe.
///
/// Why it is safe: a pin is written by a compare-and-set that requires the oldest epoch unchanged, and the collector
/// raises the oldest epoch before it reads the pins; so a pin is either refused or seen. A pin past its lease is
/// deleted by the collector with a compare-and-set before it goes further, and renewing one requires that it is there.
/// On a full disk, which takes no pins, epochs are read without: the collector gets no further there either, and should
/// it once there is space again, the hold does not stand and whoever misses a value says so. A tagged epoch below the
/// oldest may be pinned, too: that requires the tags unchanged, and the collector reads the tags before the pins, so
/// that it sees the tag or the pin.
class EpochPins final {
 public:
  /// `engine` outlives it. A pin that is not renewed expires after `seconds`.
  EpochPins(Engine& engine, Clock now, double seconds);
  ~EpochPins();

  /// Holds an epoch until it is destroyed. EpochPins outlives it.
  class Hold final {
   public:
    Hold(EpochPins& pins, uint64_t incarnation, uint64_t epoch, uint64_t generation)
        : pins_(pins), incarnation_(incarnation), epoch_(epoch), generation_(generation) {}
    ~Hold() { pins_.Release(*this); }
    Hold(const Hold&) = delete;
    Hold& operator=(const Hold&) = delete;

    /// Whether the pin still stands in the engine: it does not if this process slept past its lease.
    bool Stands() const { return pins_.Stands(*this); }

   private:
    friend class EpochPins;
    EpochPins& pins_;
    const uint64_t incarnation_, epoch_, generation_;
  };

  /// FAILED_PRECONDITION if the epoch may not be opened any more, NOT_FOUND if the map is deleted.
  absl::StatusOr<std::unique_ptr<Hold>> Pin(uint64_t incarnation, uint64_t epoch);

 private:
  /// What this process reads of one map.
  struct Reader {
    std::mutex mutex;
    std::multiset<uint64_t> open;
    uint64_t covers_from = UINT64_MAX;           ///< from which epoch on the row keeps all; below, only what is open
    std::optional<StoredRow<mapkeep::Pin>> row;  ///< as it was written last
    uint64_t generation = 0;                     ///< counts the times that the row was lost: holds of before are void
  };

  static bool Covers(const Reader& reader, uint64_t epoch);
  Reader& ReaderOf(uint64_t incarnation);
  absl::Status Place(uint64_t incarnation, Reader& reader, uint64_t epoch);
  absl::Status PlaceAnew(uint64_t incarnation, Reader& reader, uint64_t epoch);
  absl::Status Renew(uint64_t incarnation, Reader& reader);
  void RenewAll();
  void Release(const Hold& hold);
  bool Stands(const Hold& hold);

  Engine& engine_;
  const Clock now_;
  const double seconds_;
  const std::string key_;
  std::mutex mutex_;
  std::map<uint64_t, std::unique_ptr<Reader>> readers_;
  std::condition_variable stop_signal_;
  bool stop_ = false;
  std::thread renewer_;
};

}  // namespace mapkeep
