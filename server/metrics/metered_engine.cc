#include "server/metrics/metered_engine.h"

#include <chrono>
#include <utility>

namespace mapkeep {
namespace {

using std::chrono::steady_clock;

// One operation of the engine.
class Meter {
 public:
  Meter(prometheus::Registry& registry, const std::string& operation)
      : operation_(operation),
        seconds_(prometheus::BuildHistogram()
                     .Name("mapkeep_engine_seconds")
                     .Help("Calls of the store's engine, seconds")
                     .Register(registry)
                     .Add({{"operation", operation}}, DurationBuckets())),
        bytes_(prometheus::BuildCounter()
                   .Name("mapkeep_engine_bytes_total")
                   .Help("Bytes of values that the store's engine read or wrote")
                   .Register(registry)
                   .Add({{"operation", operation}})),
        errors_(prometheus::BuildCounter()
                    .Name("mapkeep_engine_errors_total")
                    .Help("Calls of the store's engine that failed; what is not there is no failure")
                    .Register(registry)) {}

  void Took(steady_clock::time_point began, const absl::Status& status, size_t bytes) {
    seconds_.Observe(std::chrono::duration<double>(steady_clock::now() - began).count());
    if (bytes > 0) bytes_.Increment(static_cast<double>(bytes));
    // A compare-and-set that lost is how the store works, not an error.
    if (status.ok() || absl::IsNotFound(status) || absl::IsAborted(status)) return;
    errors_.Add({{"operation", operation_}, {"code", absl::StatusCodeToString(status.code())}}).Increment();
  }

 private:
  const std::string operation_;
  prometheus::Histogram& seconds_;
  prometheus::Counter& bytes_;
  prometheus::Family<prometheus::Counter>& errors_;
};

size_t BytesOf(std::span<const Mutation> mutations) {
  size_t bytes = 0;
  for (const Mutation& mutation : mutations) bytes += mutation.value ? mutation.value->size() : 0;
  return bytes;
}

size_t BytesOf(std::span<const ImmutableValue> values) {
  size_t bytes = 0;
  for (const ImmutableValue& value : values) bytes += value.value.size();
  return bytes;
}

class MeteredEngine final : public Engine {
 public:
  MeteredEngine(std::unique_ptr<Engine> engine, prometheus::Registry& registry)
      : engine_(std::move(engine)),
        get_(registry, "get"),
        scan_(registry, "scan"),
        write_(registry, "write"),
        compare_and_set_(registry, "compare_and_set"),
        put_values_(registry, "put_values"),
        get_value_(registry, "get_value"),
        get_values_(registry, "get_values"),
        delete_values_(registry, "delete_values"),
        scan_keys_(registry, "scan_value_keys"),
        sync_(registry, "sync"),
        checkpoint_(registry, "checkpoint") {}

  absl::StatusOr<std::optional<std::string>> Get(std::string_view partition, std::string_view key) const override {
    const auto began = steady_clock::now();
    auto found = engine_->Get(partition, key);
    get_.Took(began, found.status(), found.ok() && *found ? (*found)->size() : 0);
    return found;
  }

  absl::Status Scan(std::string_view partition, std::string_view begin, std::string_view end,
                    const std::function<bool(std::string_view, std::string_view)>& row) const override {
    const auto began = steady_clock::now();
    size_t bytes = 0;
    const absl::Status status = engine_->Scan(partition, begin, end, [&](std::string_view key, std::string_view value) {
      bytes += value.size();
      return row(key, value);
    });
    scan_.Took(began, status, bytes);
    return status;
  }

  absl::Status Write(std::string_view partition, std::span<const Mutation> mutations, Durability durability) override {
    return Timed(write_, BytesOf(mutations), [&] { return engine_->Write(partition, mutations, durability); });
  }

  absl::Status CompareAndSet(std::string_view partition, std::span<const Condition> conditions,
                             std::span<const Mutation> mutations) override {
    return Timed(compare_and_set_, BytesOf(mutations),
                 [&] { return engine_->CompareAndSet(partition, conditions, mutations); });
  }

  absl::Status CompareAndSetBuffered(std::string_view partition, std::span<const Condition> conditions,
                                     std::span<const Mutation> mutations) override {
    return Timed(compare_and_set_, BytesOf(mutations),
                 [&] { return engine_->CompareAndSetBuffered(partition, conditions, mutations); });
  }

  absl::Status PutValues(std::string_view group, std::span<const ImmutableValue> values) override {
    return Timed(put_values_, BytesOf(values), [&] { return engine_->PutValues(group, values); });
  }

  absl::Status PutLargeValues(std::string_view group, std::span<const ImmutableValue> values) override {
    return Timed(put_values_, BytesOf(values), [&] { return engine_->PutLargeValues(group, values); });
  }

  absl::Status PutGroups(std::span<const ValueGroup> groups) override {
    size_t bytes = 0;
    for (const ValueGroup& group : groups) bytes += BytesOf(group.values);
    return Timed(put_values_, bytes, [&] { return engine_->PutGroups(groups); });
  }

  absl::StatusOr<std::string> GetValue(std::string_view group, std::string_view key) const override {
    const auto began = steady_clock::now();
    auto value = engine_->GetValue(group, key);
    get_value_.Took(began, value.status(), value.ok() ? value->size() : 0);
    return value;
  }

  /// One call, however many values.
  std::vector<absl::StatusOr<std::string>> GetValues(std::string_view group,
                                                     std::span<const std::string> keys) const override {
    const auto began = steady_clock::now();
    auto values = engine_->GetValues(group, keys);
    size_t bytes = 0;
    absl::Status failed;
    for (const auto& value : values) {
      if (value.ok()) bytes += value->size();
      if (!value.ok() && (failed.ok() || absl::IsNotFound(failed))) failed = value.status();
    }
    get_values_.Took(began, failed, bytes);
    return values;
  }

  absl::Status DeleteValues(std::string_view group, std::span<const std::string> keys) override {
    return Timed(delete_values_, 0, [&] { return engine_->DeleteValues(group, keys); });
  }

  absl::Status ScanValueKeys(std::string_view group, std::string_view begin, std::string_view end,
                             const std::function<bool(std::string_view)>& row) const override {
    return Timed(scan_keys_, 0, [&] { return engine_->ScanValueKeys(group, begin, end, row); });
  }

  absl::Status Sync() override {
    return Timed(sync_, 0, [&] { return engine_->Sync(); });
  }

  absl::Status Checkpoint(const std::string& directory) override {
    return Timed(checkpoint_, 0, [&] { return engine_->Checkpoint(directory); });
  }

 private:
  template <typename Call>
  static absl::Status Timed(Meter& meter, size_t bytes, const Call& call) {
    const auto began = steady_clock::now();
    absl::Status status = call();
    meter.Took(began, status, status.ok() ? bytes : 0);
    return status;
  }

  const std::unique_ptr<Engine> engine_;
  mutable Meter get_, scan_, write_, compare_and_set_, put_values_, get_value_, get_values_, delete_values_, scan_keys_,
      sync_, checkpoint_;
};

}  // namespace

std::unique_ptr<Engine> Metered(std::unique_ptr<Engine> engine, Metrics& metrics) {
  return std::make_unique<MeteredEngine>(std::move(engine), metrics.registry());
}

}  // namespace mapkeep
