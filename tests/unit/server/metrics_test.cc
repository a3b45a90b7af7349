#include "server/metrics/metrics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "server/metrics/call_metrics.h"
#include "server/metrics/metered_engine.h"
#include "server/metrics/pipeline_metrics.h"
#include "server/metrics/process_metrics.h"

namespace mapkeep {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

// Answers as it is told.
class ScriptedEngine final : public Engine {
 public:
  absl::Status answer;

  absl::StatusOr<std::optional<std::string>> Get(std::string_view, std::string_view) const override {
    if (!answer.ok()) return answer;
    return std::optional<std::string>("12345");
  }
  absl::Status Scan(std::string_view, std::string_view, std::string_view,
                    const std::function<bool(std::string_view, std::string_view)>& row) const override {
    row("k", "123");
    return answer;
  }
  absl::Status Write(std::string_view, std::span<const Mutation>, Durability) override { return answer; }
  absl::Status CompareAndSet(std::string_view, std::span<const Condition>, std::span<const Mutation>) override {
    return answer;
  }
  absl::Status PutValues(std::string_view, std::span<const ImmutableValue>) override { return answer; }
  absl::StatusOr<std::string> GetValue(std::string_view, std::string_view) const override {
    if (!answer.ok()) return answer;
    return std::string("1234567");
  }
  absl::Status DeleteValues(std::string_view, std::span<const std::string>) override { return answer; }
  absl::Status ScanValueKeys(std::string_view, std::string_view, std::string_view,
                             const std::function<bool(std::string_view)>&) const override {
    return answer;
  }
  absl::Status Sync() override { return answer; }
  absl::Status Checkpoint(const std::string&) override { return answer; }
};

TEST(Metrics, SourcesAreAskedAtEveryLookUntilTheyAreForgotten) {
  Metrics metrics;
  int asked = 0;
  metrics.AddGauge("mapkeep_height", "How high", [&] { return ++asked; }, {{"of", "a"}});
  metrics.AddGauge("mapkeep_height", "How high", [] { return 7; }, {{"of", "b"}});
  metrics.AddCount("mapkeep_steps_total", "Steps", [] { return 3; });
  EXPECT_THAT(metrics.Text(), AllOf(HasSubstr("mapkeep_height{of=\"a\"} 1"), HasSubstr("mapkeep_height{of=\"b\"} 7"),
                                    HasSubstr("# TYPE mapkeep_steps_total counter\nmapkeep_steps_total 3")));
  EXPECT_THAT(metrics.Text(), HasSubstr("mapkeep_height{of=\"a\"} 2"));
  metrics.ForgetSources();
  EXPECT_THAT(metrics.Text(), Not(HasSubstr("mapkeep_height")));
  EXPECT_EQ(asked, 2);
}

TEST(Metrics, EngineCallsAreTimedAndTheirErrorsCounted) {
  Metrics metrics;
  auto scripted = std::make_unique<ScriptedEngine>();
  absl::Status& answer = scripted->answer;
  const auto engine = Metered(std::move(scripted), metrics);
  EXPECT_TRUE(engine->GetValue("g", "k").ok());
  EXPECT_EQ(engine->GetValues("g", std::vector<std::string>{"k", "l"}).size(), 2U);
  const std::vector<ImmutableValue> values = {{"k", "123"}, {"l", "45"}};
  EXPECT_TRUE(engine->PutValues("g", values).ok());
  const std::vector<ValueGroup> groups = {{"g", values}};
  EXPECT_TRUE(engine->PutGroups(groups).ok());
  answer = absl::DataLossError("x");
  EXPECT_FALSE(engine->Sync().ok());
  answer = absl::NotFoundError("x");
  EXPECT_FALSE(engine->GetValue("g", "k").ok());
  EXPECT_FALSE(engine->GetValues("g", std::vector<std::string>{"k", "l"}).front().ok());
  answer = absl::AbortedError("x");
  EXPECT_FALSE(engine->CompareAndSet("p", {}, {}).ok());
  EXPECT_THAT(metrics.Text(), AllOf(HasSubstr("mapkeep_engine_seconds_count{operation=\"get_value\"} 2"),
                                    HasSubstr("mapkeep_engine_bytes_total{operation=\"get_value\"} 7"),
                                    HasSubstr("mapkeep_engine_seconds_count{operation=\"get_values\"} 2"),
                                    HasSubstr("mapkeep_engine_bytes_total{operation=\"get_values\"} 14"),
                                    HasSubstr("mapkeep_engine_bytes_total{operation=\"put_values\"} 10"),
                                    HasSubstr("mapkeep_engine_errors_total{code=\"DATA_LOSS\",operation=\"sync\"} 1"),
                                    Not(HasSubstr("NOT_FOUND")), Not(HasSubstr("ABORTED"))));
}

TEST(Metrics, CallsAreCountedByMethodAndStatus) {
  Metrics metrics;
  CallMetrics calls(metrics);
  calls.Began("/s/A");
  calls.Began("/s/A");
  calls.Ended("/s/A", "OK", 0.003);
  calls.Staged(2, 100);
  calls.Pending(500);
  calls.Pending(-200);
  EXPECT_THAT(metrics.Text(),
              AllOf(HasSubstr("mapkeep_calls_open{method=\"/s/A\"} 1"),
                    HasSubstr("mapkeep_calls_total{code=\"OK\",method=\"/s/A\"} 1"),
                    HasSubstr("mapkeep_call_seconds_bucket{method=\"/s/A\",le=\"0.005\"} 1"),
                    HasSubstr("mapkeep_upload_scans_total 2"), HasSubstr("mapkeep_upload_bytes_total 100"),
                    HasSubstr("mapkeep_upload_pending_bytes 300")));
}

TEST(Metrics, StagesAndEndsAreCounted) {
  Metrics metrics;
  int changed = 0;
  const PipelineEvents events = CountedEvents(metrics, [&](const SessionRecord&) { ++changed; });
  EXPECT_THAT(metrics.Text(), HasSubstr("mapkeep_sessions_ended_total{state=\"refused\"} 0"));
  events.stage_done("align", 0.3);
  SessionRecord session;
  session.state = SessionState::kCommitted;
  events.ended(session);
  events.changed(session);
  EXPECT_EQ(changed, 1);
  EXPECT_THAT(metrics.Text(), AllOf(HasSubstr("mapkeep_stage_seconds_count{stage=\"align\"} 1"),
                                    HasSubstr("mapkeep_sessions_ended_total{state=\"committed\"} 1")));
}

TEST(Metrics, TheProcessIsMeasured) {
  Metrics metrics;
  AddProcessMetrics(metrics);
  const std::string text = metrics.Text();
  for (const char* name : {"resident_bytes", "heap_used_bytes", "heap_free_bytes", "threads", "open_files", "open_files_limit", "cpu_seconds_total"}) {
    EXPECT_THAT(text, HasSubstr(std::string("mapkeep_process_") + name));
    EXPECT_THAT(text, Not(HasSubstr(std::string("mapkeep_process_") + name + " 0\n")));
  }
}

}  // namespace
}  // namespace mapkeep
