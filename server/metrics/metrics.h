#pragma once

#include <prometheus/collectable.h>
#include <prometheus/counter.h>
#include <prometheus/histogram.h>
#include <prometheus/labels.h>
#include <prometheus/registry.h>

#include <functional>
#include <memory>
#include <string>

namespace mapkeep {

/// Everything that /metrics shows: counters and histograms in a Prometheus registry, which each part is given, and
/// values that are asked for when somebody looks. Names begin with "mapkeep_". Thread-safe.
class Metrics {
 public:
  Metrics();
  ~Metrics();
  Metrics(const Metrics&) = delete;
  Metrics& operator=(const Metrics&) = delete;

  prometheus::Registry& registry() { return *registry_; }

  /// `value` is asked at every look, until Forget.
  void AddGauge(const std::string& name, const std::string& help, std::function<double()> value,
                const prometheus::Labels& labels = {});
  /// Likewise of a count that only rises, kept by whoever counts.
  void AddCount(const std::string& name, const std::string& help, std::function<double()> value,
                const prometheus::Labels& labels = {});
  /// What was added is not asked any more, nor being asked, once this returns: for before its sources go.
  void ForgetSources();

  /// The text format, version 0.0.4.
  std::string Text() const;

 private:
  class Sources;

  std::unique_ptr<prometheus::Registry> registry_;
  std::unique_ptr<Sources> sources_;
};

/// Buckets for durations, seconds: from 0.1 ms to 100 s, three a decade.
const prometheus::Histogram::BucketBoundaries& DurationBuckets();

}  // namespace mapkeep
