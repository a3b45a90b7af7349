#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace mapkeep {

/// A row to write, or to delete (no value).
struct Mutation {
  std::string key;
  std::optional<std::string> value;
};

/// What a row must be for a compare-and-set to happen: this value, or absent (no value).
struct Condition {
  std::string key;
  std::optional<std::string> value;
};

/// An immutable value, written once under a key that never comes back with other content.
struct ImmutableValue {
  std::string key;
  std::string value;
};

/// Values of one group.
struct ValueGroup {
  std::string group;
  std::vector<ImmutableValue> values;
};

enum class Durability {
  kBuffered,  ///< survives the process, and becomes durable with the partition's next durable write or Sync
  kDurable,   ///< survives power loss once the call returns
};

/// The key-value store underneath: what RocksDB and Ceph RADOS can both do, and nothing else. Partitions are named
/// groups of rows ordered by key as bytes. Thread-safe. A status of UNKNOWN or DEADLINE_EXCEEDED from a write means
/// that it may have been applied, or may still be; every other error means that it was not and will not be:
/// RESOURCE_EXHAUSTED for want of space, INVALID_ARGUMENT for a partition or group whose name is empty or longer than
/// 1,000 bytes. A read of damaged bytes is DATA_LOSS.
class Engine {
 public:
  virtual ~Engine() = default;

  /// The row's value, or nothing.
  virtual absl::StatusOr<std::optional<std::string>> Get(std::string_view partition, std::string_view key) const = 0;

  /// Calls `row` for each row with begin <= key < end (an empty end: to the last), in order, until it returns false.
  /// Each row is read whole; rows written during the scan may or may not be seen.
  virtual absl::Status Scan(std::string_view partition, std::string_view begin, std::string_view end,
                            const std::function<bool(std::string_view key, std::string_view value)>& row) const = 0;

  /// All mutations or none.
  virtual absl::Status Write(std::string_view partition, std::span<const Mutation> mutations,
                             Durability durability) = 0;

  /// If every condition holds, applies every mutation, in one atomic and durable step; otherwise ABORTED naming the
  /// first condition that failed. Everything this process wrote before, in any partition and as a value, is durable
  /// with it.
  virtual absl::Status CompareAndSet(std::string_view partition, std::span<const Condition> conditions,
                                     std::span<const Mutation> mutations) = 0;

  /// CompareAndSet, but durable only with the next durable write: for what need not outlive what is written after it.
  virtual absl::Status CompareAndSetBuffered(std::string_view partition, std::span<const Condition> conditions,
                                             std::span<const Mutation> mutations) {
    return CompareAndSet(partition, conditions, mutations);
  }

  /// Writes values that nobody changes afterwards, together under one group (a tile, a session): not atomic, durable
  /// with the next durable write. The same values may be written again.
  virtual absl::Status PutValues(std::string_view group, std::span<const ImmutableValue> values) = 0;

  /// PutValues of several groups, at once where an engine can.
  virtual absl::Status PutGroups(std::span<const ValueGroup> groups) {
    for (const ValueGroup& group : groups) {
      if (absl::Status status = PutValues(group.group, group.values); !status.ok()) return status;
    }
    return absl::OkStatus();
  }

  /// PutValues of megabytes that will be deleted together, which an engine may write in a way of its own.
  virtual absl::Status PutLargeValues(std::string_view group, std::span<const ImmutableValue> values) {
    return PutValues(group, values);
  }

  /// NOT_FOUND if it was never written or is deleted.
  virtual absl::StatusOr<std::string> GetValue(std::string_view group, std::string_view key) const = 0;

  /// GetValue of several keys of a group, each with its own answer, in their order: together where an engine can.
  virtual std::vector<absl::StatusOr<std::string>> GetValues(std::string_view group,
                                                             std::span<const std::string> keys) const {
    std::vector<absl::StatusOr<std::string>> values;
    values.reserve(keys.size());
    for (const std::string& key : keys) values.push_back(GetValue(group, key));
    return values;
  }

  /// Deleting what is not there is fine.
  virtual absl::Status DeleteValues(std::string_view group, std::span<const std::string> keys) = 0;

  /// Keys of a group in order, for the collector and checks.
  virtual absl::Status ScanValueKeys(std::string_view group, std::string_view begin, std::string_view end,
                                     const std::function<bool(std::string_view key)>& row) const = 0;

  /// Makes everything written so far durable.
  virtual absl::Status Sync() = 0;

  /// A consistent copy of everything in a new directory, while serving. UNIMPLEMENTED where there is no such thing.
  virtual absl::Status Checkpoint(const std::string& directory) = 0;
};

}  // namespace mapkeep
