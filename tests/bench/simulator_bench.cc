#include <benchmark/benchmark.h>

#include "client/simulator/street_session.h"

namespace mapkeep {
namespace {

/// Scans a second of each sensor in a street with its traffic, generated while read.
void DriveThroughAStreet(benchmark::State& state, const char* sensor) {
  const auto street = MakeStreet({});
  if (!street.ok()) return state.SkipWithError(street.status().ToString().c_str());
  DriveParameters drive{.sensor = *SensorNamed(sensor), .scans = 150};
  const auto session = DriveThrough(*street, 0, drive);
  if (!session.ok()) return state.SkipWithError(session.status().ToString().c_str());
  size_t scan = 0;
  double points = 0, moving = 0;
  for (auto _ : state) {
    const auto labelled = session->labelled(scan++ % session->scans.count);
    if (!labelled.ok()) return state.SkipWithError(labelled.status().ToString().c_str());
    points += static_cast<double>(labelled->scan.points.size());
    for (const uint32_t label : labelled->labels) moving += ClassOfLabel(label) == kMovingLabel ? 1 : 0;
  }
  state.counters["scans/s"] = benchmark::Counter(static_cast<double>(state.iterations()), benchmark::Counter::kIsRate);
  state.counters["points"] = points / static_cast<double>(state.iterations());
  state.counters["moving %"] = 100 * moving / points;
}

BENCHMARK_CAPTURE(DriveThroughAStreet, hdl64, "hdl64")
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime()
    ->MinTime(3);
BENCHMARK_CAPTURE(DriveThroughAStreet, os1_64, "os1-64")
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime();
BENCHMARK_CAPTURE(DriveThroughAStreet, vlp16, "vlp16")
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime();
BENCHMARK_CAPTURE(DriveThroughAStreet, livox, "livox")
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime();

}  // namespace
}  // namespace mapkeep
