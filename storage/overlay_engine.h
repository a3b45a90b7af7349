#pragma once

#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>

#include "storage/engine.h"

namespace mapkeep {

/// What another engine would hold after the writes made here, which stay in memory: for trying out what an operation
/// would do. Checkpoint is UNIMPLEMENTED. Thread-safe.
class OverlayEngine final : public Engine {
 public:
  /// `engine` outlives it.
  explicit OverlayEngine(const Engine& engine) : engine_(engine) {}

  absl::StatusOr<std::optional<std::string>> Get(std::string_view partition, std::string_view key) const override;
  absl::Status Scan(std::string_view partition, std::string_view begin, std::string_view end,
                    const std::function<bool(std::string_view key, std::string_view value)>& row) const override;
  absl::Status Write(std::string_view partition, std::span<const Mutation> mutations, Durability durability) override;
  absl::Status CompareAndSet(std::string_view partition, std::span<const Condition> conditions,
                             std::span<const Mutation> mutations) override;
  absl::Status PutValues(std::string_view group, std::span<const ImmutableValue> values) override;
  absl::StatusOr<std::string> GetValue(std::string_view group, std::string_view key) const override;
  absl::Status DeleteValues(std::string_view group, std::span<const std::string> keys) override;
  absl::Status ScanValueKeys(std::string_view group, std::string_view begin, std::string_view end,
                             const std::function<bool(std::string_view key)>& row) const override;
  absl::Status Sync() override { return absl::OkStatus(); }
  absl::Status Checkpoint(const std::string& directory) override;

 private:
  /// Changes of one partition or group: new values, or nothing for what is deleted.
  using Changes = std::map<std::string, std::optional<std::string>, std::less<>>;
  using ChangesByName = std::map<std::string, Changes, std::less<>>;

  static Changes ChangesOf(const ChangesByName& all, std::string_view name);

  const Engine& engine_;
  mutable std::recursive_mutex mutex_;  ///< a scan's callback may read
  ChangesByName rows_, values_;
};

}  // namespace mapkeep
