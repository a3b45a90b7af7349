#include "server/metrics/call_metrics.h"

#include <prometheus/gauge.h>

namespace mapkeep {

CallMetrics::CallMetrics(Metrics& metrics)
    : calls_(prometheus::BuildCounter()
                 .Name("mapkeep_calls_total")
                 .Help("gRPC calls that ended, by their status")
                 .Register(metrics.registry())),
      seconds_(prometheus::BuildHistogram()
                   .Name("mapkeep_call_seconds")
                   .Help("gRPC calls from their headers to their status, seconds; streams last as long as clients like")
                   .Register(metrics.registry())),
      open_(prometheus::BuildGauge()
                .Name("mapkeep_calls_open")
                .Help("gRPC calls under way")
                .Register(metrics.registry())),
      upload_bytes_(prometheus::BuildCounter()
                        .Name("mapkeep_upload_bytes_total")
                        .Help("Bytes of scans as they came, that became durable")
                        .Register(metrics.registry())
                        .Add({})),
      upload_scans_(prometheus::BuildCounter()
                        .Name("mapkeep_upload_scans_total")
                        .Help("Scans that became durable")
                        .Register(metrics.registry())
                        .Add({})),
      pending_bytes_(prometheus::BuildGauge()
                         .Name("mapkeep_upload_pending_bytes")
                         .Help("Bytes of messages and whole scans that were received and are not durable yet, all uploads")
                         .Register(metrics.registry())
                         .Add({})),
      quota_refusals_(prometheus::BuildCounter()
                          .Name("mapkeep_quota_refusals_total")
                          .Help("Calls that a quota refused")
                          .Register(metrics.registry())) {}

void CallMetrics::Began(const std::string& method) { open_.Add({{"method", method}}).Increment(); }

void CallMetrics::Ended(const std::string& method, const std::string& code, double seconds) {
  open_.Add({{"method", method}}).Decrement();
  calls_.Add({{"method", method}, {"code", code}}).Increment();
  seconds_.Add({{"method", method}}, DurationBuckets()).Observe(seconds);
}

void CallMetrics::Staged(size_t scans, size_t bytes) {
  upload_scans_.Increment(static_cast<double>(scans));
  upload_bytes_.Increment(static_cast<double>(bytes));
}

void CallMetrics::QuotaRefused(const std::string& quota) { quota_refusals_.Add({{"quota", quota}}).Increment(); }

}  // namespace mapkeep
