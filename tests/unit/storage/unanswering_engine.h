#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "storage/engine.h"

namespace mapkeep {

/// What becomes of an operation that is reported as timed out.
enum class Fate {
  kAnswered,  ///< nothing special
  kApplied,   ///< applied, but reported as DEADLINE_EXCEEDED
  kLost,      ///< never applied
  kLate,      ///< applied when ApplyLate is called, or after the engine's delay
};

/// An engine on top of a real one, whose compare-and-sets time out as `fate` says. Those that are late arrive by
/// themselves after `delay`, unless that is zero.
class UnansweringEngine final : public Engine {
 public:
  UnansweringEngine(Engine& engine, std::function<Fate()> fate, std::chrono::milliseconds delay = {})
      : engine_(engine), fate_(std::move(fate)), delay_(delay) {
    if (delay.count() > 0) {
      postman_ = std::jthread([this](const std::stop_token& stop) { Deliver(stop); });
    }
  }

  /// What was on its way arrives, in the order it was sent.
  void ApplyLate() {
    std::deque<Late> late;
    {
      const std::scoped_lock lock(mutex_);
      late.swap(late_);
    }
    for (const Late& operation : late) operation.apply();
  }

  absl::Status CompareAndSet(std::string_view partition, std::span<const Condition> conditions,
                             std::span<const Mutation> mutations) override {
    Fate fate;
    {
      const std::scoped_lock lock(mutex_);
      fate = fate_();
      if (fate == Fate::kLate) {
        late_.push_back(
            {std::chrono::steady_clock::now() + delay_,
             [this, partition = std::string(partition), conditions = std::vector(conditions.begin(), conditions.end()),
              mutations = std::vector(mutations.begin(), mutations.end())] {
               engine_.CompareAndSet(partition, conditions, mutations).IgnoreError();
             }});
        arrived_.notify_all();
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
  /// An operation on its way.
  struct Late {
    std::chrono::steady_clock::time_point due;
    std::function<void()> apply;
  };

  void Deliver(const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    while (arrived_.wait(lock, stop, [this] { return !late_.empty(); })) {
      const auto due = late_.front().due;
      if (arrived_.wait_until(lock, stop, due, [due] { return std::chrono::steady_clock::now() >= due; }) &&
          !late_.empty()) {
        const Late operation = std::move(late_.front());
        late_.pop_front();
        lock.unlock();
        operation.apply();
        lock.lock();
      }
      if (stop.stop_requested()) return;
    }
  }

  Engine& engine_;
  std::mutex mutex_;
  std::condition_variable_any arrived_;
  std::function<Fate()> fate_;
  std::deque<Late> late_;
  const std::chrono::milliseconds delay_;
  std::jthread postman_;
};

}  // namespace mapkeep
