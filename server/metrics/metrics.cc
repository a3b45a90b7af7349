#include "server/metrics/metrics.h"

#include <prometheus/metric_family.h>
#include <prometheus/text_serializer.h>

#include <iterator>
#include <map>
#include <mutex>
#include <utility>
#include <vector>

namespace mapkeep {

class Metrics::Sources {
 public:
  void Add(const std::string& name, const std::string& help, prometheus::MetricType type, std::function<double()> value,
           const prometheus::Labels& labels) {
    const std::lock_guard lock(mutex_);
    Family& family = families_[name];
    family.help = help;
    family.type = type;
    family.members.push_back({labels, std::move(value)});
  }

  void Clear() {
    const std::lock_guard lock(mutex_);
    families_.clear();
  }

  std::vector<prometheus::MetricFamily> Collect() const {
    const std::lock_guard lock(mutex_);
    std::vector<prometheus::MetricFamily> collected;
    for (const auto& [name, family] : families_) {
      prometheus::MetricFamily& added = collected.emplace_back();
      added.name = name;
      added.help = family.help;
      added.type = family.type;
      for (const auto& [labels, value] : family.members) {
        prometheus::ClientMetric& metric = added.metric.emplace_back();
        for (const auto& [key, text] : labels) metric.label.push_back({key, text});
        (family.type == prometheus::MetricType::Counter ? metric.counter.value : metric.gauge.value) = value();
      }
    }
    return collected;
  }

 private:
  struct Member {
    prometheus::Labels labels;
    std::function<double()> value;
  };
  struct Family {
    std::string help;
    prometheus::MetricType type = prometheus::MetricType::Gauge;
    std::vector<Member> members;
  };
  mutable std::mutex mutex_;
  std::map<std::string, Family> families_;
};

Metrics::Metrics() : registry_(std::make_unique<prometheus::Registry>()), sources_(std::make_unique<Sources>()) {}

Metrics::~Metrics() = default;

void Metrics::AddGauge(const std::string& name, const std::string& help, std::function<double()> value,
                       const prometheus::Labels& labels) {
  sources_->Add(name, help, prometheus::MetricType::Gauge, std::move(value), labels);
}

void Metrics::AddCount(const std::string& name, const std::string& help, std::function<double()> value,
                       const prometheus::Labels& labels) {
  sources_->Add(name, help, prometheus::MetricType::Counter, std::move(value), labels);
}

void Metrics::ForgetSources() { sources_->Clear(); }

std::string Metrics::Text() const {
  std::vector<prometheus::MetricFamily> families = registry_->Collect();
  std::vector<prometheus::MetricFamily> asked = sources_->Collect();
  families.insert(families.end(), std::make_move_iterator(asked.begin()), std::make_move_iterator(asked.end()));
  return prometheus::TextSerializer().Serialize(families);
}

const prometheus::Histogram::BucketBoundaries& DurationBuckets() {
  static const auto* const buckets = new prometheus::Histogram::BucketBoundaries{
      0.0001, 0.0002, 0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100};
  return *buckets;
}

}  // namespace mapkeep
