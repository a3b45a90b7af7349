#pragma once

#include <cstddef>
#include <string>

#include "server/metrics/metrics.h"

namespace mapkeep {

/// What calls and uploads count: mapkeep_calls_total{method,code}, mapkeep_call_seconds{method},
/// mapkeep_calls_open{method}, mapkeep_upload_bytes_total, mapkeep_upload_scans_total, mapkeep_upload_pending_bytes,
/// mapkeep_quota_refusals_total{quota}. Thread-safe.
class CallMetrics {
 public:
  /// `metrics` outlives it.
  explicit CallMetrics(Metrics& metrics);

  void Began(const std::string& method);
  /// `code` by its name, "OK" or "NOT_FOUND".
  void Ended(const std::string& method, const std::string& code, double seconds);

  /// Scans became durable.
  void Staged(size_t scans, size_t bytes);
  /// Bytes of scans came in (or, negative, went) that are not durable yet.
  void Pending(double bytes) { pending_bytes_.Increment(bytes); }

  void QuotaRefused(const std::string& quota);

 private:
  prometheus::Family<prometheus::Counter>& calls_;
  prometheus::Family<prometheus::Histogram>& seconds_;
  prometheus::Family<prometheus::Gauge>& open_;
  prometheus::Counter& upload_bytes_;
  prometheus::Counter& upload_scans_;
  prometheus::Gauge& pending_bytes_;
  prometheus::Family<prometheus::Counter>& quota_refusals_;
};

}  // namespace mapkeep
