#include "server/metrics/process_metrics.h"

#include <malloc.h>
#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>

namespace mapkeep {
namespace {

// A line "KEY: NUMBER" of /proc/self/status.
double StatusNumber(const std::string& key) {
  std::ifstream in("/proc/self/status");
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with(key)) return std::strtod(line.c_str() + key.size(), nullptr);
  }
  return 0;
}

double OpenFiles() {
  std::error_code error;
  double files = 0;
  for (const auto& file : std::filesystem::directory_iterator("/proc/self/fd", error)) {
    files += file.path().empty() ? 0 : 1;
  }
  return files;
}

double OpenFileLimit() {
  rlimit limit{};
  getrlimit(RLIMIT_NOFILE, &limit);
  return static_cast<double>(limit.rlim_cur);
}

double ProcessorSeconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_usec) / 1e6;
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

}  // namespace

void AddProcessMetrics(Metrics& metrics) {
  const double started = std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
  metrics.AddGauge("mapkeep_process_resident_bytes", "Memory of the daemon that is in RAM",
                   [] { return 1024 * StatusNumber("VmRSS:"); });
  // Both walk through what the allocator has: what is resident and in neither is stacks, programs and mapped files.
  metrics.AddGauge("mapkeep_process_heap_used_bytes", "Memory that the daemon's parts hold", [] {
    const auto heap = mallinfo2();
    return static_cast<double>(heap.uordblks + heap.hblkhd);
  });
  metrics.AddGauge("mapkeep_process_heap_free_bytes", "Memory that the allocator holds and nobody uses",
                   [] { return static_cast<double>(mallinfo2().fordblks); });
  metrics.AddGauge("mapkeep_process_threads", "Threads of the daemon", [] { return StatusNumber("Threads:"); });
  metrics.AddGauge("mapkeep_process_open_files", "Files and sockets that the daemon has open", OpenFiles);
  metrics.AddGauge("mapkeep_process_open_files_limit", "As many as it may have", OpenFileLimit);
  metrics.AddCount("mapkeep_process_cpu_seconds_total", "Processor time of the daemon", ProcessorSeconds);
  metrics.AddGauge("mapkeep_process_start_time_seconds", "When the daemon started, seconds since 1970 (UTC)",
                   [started] { return started; });
}

}  // namespace mapkeep
