#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "storage/engine.h"
#include "storage/map_layout.h"
#include "storage/map_store.h"
#include "storage/map_tree.h"

namespace mapkeep {

// The rows of map_layout.h as values, with their encodings. Decoding damaged bytes is DATA_LOSS.

/// One state of a map: rows `head` and `root/<epoch>`.
struct EpochState {
  uint64_t epoch = 0;
  uint64_t sessions = 0;  ///< merged up to here
  TreeRoot root;
  std::optional<Eigen::Vector3d> origin;
  uint64_t rollback = 0;  ///< the newest rollback among the commits that made this state; 0: none
};

/// Values that no epoch from one on reaches.
struct Superseded {
  std::vector<ValueName> names;
  std::vector<uint64_t> needed_by;  ///< tagged epochs that the collector found to reach each of them
};

/// The names of epochs.
struct Tags {
  std::vector<Tag> tags;  ///< by name
};

/// A commit that a rollback took out of the map.
struct Withdrawn {
  uint64_t epoch = 0;     ///< the commit's
  uint64_t rollback = 0;  ///< the epoch that the rollback made
};

/// An attempt to commit that is under way.
struct Intent {
  std::string session;
  uint64_t attempt = 0;
  uint64_t nonce = 0;  ///< changed to find out what became of an operation whose outcome is unknown
  uint64_t fence = 0;
  double expires = 0;  ///< seconds since 1970 (UTC)
};

/// Which commit brought a session into the map.
struct Applied {
  uint64_t epoch = 0;
  uint64_t attempt = 0;
};

/// What a round of an attempt writes.
struct Staged {
  std::string session;
  uint64_t attempt = 0;
  std::vector<ValueName> values;
};

/// A map incarnation to be removed for good.
struct PurgeOrder {
  uint64_t incarnation = 0;
  double after = 0;  ///< not before; seconds since 1970 (UTC)
  bool begun = false;
};

/// The lowest epoch that a reader uses.
struct Pin {
  uint64_t epoch = 0;
  double expires = 0;  ///< seconds since 1970 (UTC)
};

/// A row of leases.
struct LeaseEntry {
  std::string holder;
  uint64_t fence = 0;
  double expires = 0;  ///< seconds since 1970 (UTC)
};

std::string EncodeRow(const MapRecord& map);
std::string EncodeRow(const EpochState& state);
std::string EncodeRow(const Intent& intent);
std::string EncodeRow(const Applied& applied);
std::string EncodeRow(const Staged& staged);
std::string EncodeRow(const PurgeOrder& order);
std::string EncodeRow(const Pin& pin);
std::string EncodeRow(const LeaseEntry& lease);
std::string EncodeRow(const CommitRecord& commit);
std::string EncodeRow(const Superseded& superseded);
std::string EncodeRow(const Tags& tags);
std::string EncodeRow(const Withdrawn& withdrawn);
/// Counters: 16 hexadecimal digits.
std::string EncodeRow(uint64_t number);

absl::StatusOr<MapRecord> DecodeMap(std::string_view row);
absl::StatusOr<EpochState> DecodeEpoch(std::string_view row);
absl::StatusOr<Intent> DecodeIntent(std::string_view row);
absl::StatusOr<Applied> DecodeApplied(std::string_view row);
absl::StatusOr<Staged> DecodeStaged(std::string_view row);
absl::StatusOr<PurgeOrder> DecodePurge(std::string_view row);
absl::StatusOr<Pin> DecodePin(std::string_view row);
absl::StatusOr<LeaseEntry> DecodeLease(std::string_view row);
absl::StatusOr<CommitRecord> DecodeCommit(std::string_view row);
absl::StatusOr<Superseded> DecodeSuperseded(std::string_view row);
absl::StatusOr<Tags> DecodeTags(std::string_view row);
absl::StatusOr<Withdrawn> DecodeWithdrawn(std::string_view row);
absl::StatusOr<uint64_t> DecodeNumber(std::string_view row);

/// CommitRecord::attempt, and the 64 bits in it.
std::string AttemptName(std::string_view session, uint64_t attempt);
uint64_t AttemptOf(const CommitRecord& commit);

/// Random bits that no other process draws.
uint64_t Random64();

bool IsTagged(const Tags& tags, uint64_t epoch);

/// The incarnation that has the name now; NOT_FOUND without one.
absl::StatusOr<uint64_t> FindIncarnation(const Engine& engine, std::string_view map);

/// A row as it is and as it reads: the bytes are what a compare-and-set requires.
template <typename Value>
struct StoredRow {
  std::string bytes;
  Value value;
};

/// The bytes of a row that may be absent, as a condition wants them.
template <typename Value>
std::optional<std::string> BytesOf(const std::optional<StoredRow<Value>>& row) {
  return row ? std::optional(row->bytes) : std::nullopt;
}

/// The row decoded by `decode`, or nothing if it is absent.
template <typename Value>
absl::StatusOr<std::optional<StoredRow<Value>>> ReadRow(const Engine& engine, std::string_view partition,
                                                        std::string_view key,
                                                        absl::StatusOr<Value> (*decode)(std::string_view)) {
  absl::StatusOr<std::optional<std::string>> bytes = engine.Get(partition, key);
  if (!bytes.ok()) return bytes.status();
  if (!*bytes) return std::optional<StoredRow<Value>>();
  absl::StatusOr<Value> value = decode(**bytes);
  if (!value.ok()) return value.status();
  return std::optional(StoredRow<Value>{**std::move(bytes), *std::move(value)});
}

}  // namespace mapkeep
