#pragma once

#include <functional>
#include <mutex>
#include <utility>
#include <vector>

#include "storage/engine.h"

namespace mapkeep {

/// What becomes of an operation that is reported as timed out.
enum class Fate {
  kAnswered,  ///< nothing special
  kApplied,   ///< applied, but reported as DEADLINE_EXCEEDED
  kLost,      ///< never applied
  kLate,      ///< applied when ApplyLate is called
};

/// An engine on top of a real one, whose compare-and-sets time out as `fate` says.
class UnansweringEngine final : public Engine {
 public:
  UnansweringEngine(Engine& engine, std::function<Fate()> fate) : engine_(engine), fate_(std::move(fate)) {}

  /// What was on its way arrives, in the order it was sent.
  void ApplyLate() {
    std::vector<std::function<void()>> late;
    {
      const std::scoped_lock lock(mutex_);
      late.swap(late_);
    }
    for (const auto& operation : late) operation();
  }

  absl::Status CompareAndSet(std::string_view partition, std::span<const Condition> conditions,
                             std::span<const Mutation> mutations) override {
    Fate fate;
    {
      const std::scoped_lock lock(mutex_);
      fate = fate_();
      if (fate == Fate::kLate) {
        late_.push_back([this, partition = std::string(partition),
                         conditions = std::vector(conditions.begin(), conditions.end()),
                         mutations = std::vector(mutations.begin(), mutations.end())] {
          engine_.CompareAndSet(partition, conditions, mutations).IgnoreError();
        });
      }
    }
    if (fate == Fate::kAnswered) return engine_.CompareAndSet(partition, conditions, mutations);
    if (fate == Fate::kApplied) engine_.CompareAndSet(partition, conditions, mutations).IgnoreError();
    return absl::DeadlineExceededError("no answer");
  }

  absl::StatusOr<std::optional<std::string>> Get(std::string_view partition, std::string_view key) const override {
    return engine_.Get(partition, key);
  }
  absl::Status Scan(std::string_view partition, std::string_view begin, std::string_view end,
                    const std::function<bool(std::string_view, std::string_view)>& row) const override {
    return engine_.Scan(partition, begin, end, row);
  }
  absl::Status Write(std::string_view partition, std::span<const Mutation> mutations, Durability durability) override {
    return engine_.Write(partition, mutations, durability);
  }
  absl::Status PutValues(std::string_view group, std::span<const ImmutableValue> values) override {
    return engine_.PutValues(group, values);
  }
  absl::StatusOr<std::string> GetValue(std::string_view group, std::string_view key) const override {
    return engine_.GetValue(group, key);
  }
  absl::Status DeleteValues(std::string_view group, std::span<const std::string> keys) override {
    return engine_.DeleteValues(group, keys);
  }
  absl::Status ScanValueKeys(std::string_view group, std::string_view begin, std::string_view end,
                             const std::function<bool(std::string_view)>& row) const override {
    return engine_.ScanValueKeys(group, begin, end, row);
  }
  absl::Status Sync() override { return engine_.Sync(); }
  absl::Status Checkpoint(const std::string& directory) override { return engine_.Checkpoint(directory); }

 private:
  Engine& engine_;
  std::mutex mutex_;
  std::function<Fate()> fate_;
  std::vector<std::function<void()>> late_;
};

}  // namespace mapkeep
