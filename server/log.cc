#include "server/log.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <nlohmann/json.hpp>
#include <utility>

namespace mapkeep {
namespace {

std::atomic<LogFormat> log_format{LogFormat::kText};
thread_local const LogTags* current_tags = nullptr;

// As JSON writes it, with bytes that are no UTF-8 replaced: names in error messages come from outside.
std::string Quoted(std::string_view text) {
  return nlohmann::json(text).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

bool NeedsQuotes(std::string_view text) {
  return text.empty() || text.find_first_of(" =\"\\\n\t") != std::string_view::npos;
}

std::vector<LogField> WithTags(std::initializer_list<LogField> fields) {
  std::vector<LogField> all(fields);
  if (current_tags == nullptr) return all;
  for (const auto& [key, value] : *current_tags) {
    if (std::ranges::none_of(fields, [&key](const LogField& field) { return field.key == key; })) {
      all.emplace_back(key, value);
    }
  }
  return all;
}

void Write(spdlog::level::level_enum level, std::string_view event, std::initializer_list<LogField> given) {
  const std::vector<LogField> fields = WithTags(given);
  std::string line;
  if (log_format == LogFormat::kJson) {
    line = absl::StrCat("\"event\":", Quoted(event));
    for (const LogField& field : fields) {
      absl::StrAppend(&line, ",", Quoted(field.key), ":", field.is_number ? field.value : Quoted(field.value));
    }
  } else {
    line = event;
    for (const LogField& field : fields) {
      absl::StrAppendFormat(&line, " %s=%s", field.key, NeedsQuotes(field.value) ? Quoted(field.value) : field.value);
    }
  }
  spdlog::log(level, "{}", line);
}

}  // namespace

LogField::LogField(std::string_view name, double number)
    : key(name), value(absl::StrFormat("%.6g", number)), is_number(true) {}

LogScope::LogScope(LogTags tags) : tags_(std::move(tags)), outer_(std::exchange(current_tags, &tags_)) {}

LogScope::~LogScope() { current_tags = outer_; }

void StartLogging(LogFormat format) {
  log_format = format;
  auto logger = std::make_shared<spdlog::logger>("mapkeepd", std::make_shared<spdlog::sinks::stderr_sink_mt>());
  logger->set_pattern(format == LogFormat::kJson ? R"({"time":"%Y-%m-%dT%H:%M:%S.%eZ","level":"%l",%v})"
                                                 : "%Y-%m-%dT%H:%M:%S.%eZ %l %v",
                      spdlog::pattern_time_type::utc);
  logger->flush_on(spdlog::level::trace);
  spdlog::set_default_logger(std::move(logger));
}

void LogInfo(std::string_view event, std::initializer_list<LogField> fields) {
  Write(spdlog::level::info, event, fields);
}

void LogWarning(std::string_view event, std::initializer_list<LogField> fields) {
  Write(spdlog::level::warn, event, fields);
}

void LogError(std::string_view event, std::initializer_list<LogField> fields) {
  Write(spdlog::level::err, event, fields);
}

}  // namespace mapkeep
