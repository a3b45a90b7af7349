#pragma once

#include <concepts>
#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "server/config.h"

namespace mapkeep {

/// One key=value of a log line.
struct LogField {
  LogField(std::string_view name, std::string_view text) : key(name), value(text) {}
  LogField(std::string_view name, const char* text) : key(name), value(text) {}
  LogField(std::string_view name, const std::string& text) : key(name), value(text) {}
  LogField(std::string_view name, double number);
  template <std::integral T>
  LogField(std::string_view name, T number) : key(name), value(std::to_string(number)), is_number(true) {}

  std::string_view key;
  std::string value;
  bool is_number = false;
};

/// Keys and values that belong to whatever is done now, not to one event.
using LogTags = std::vector<std::pair<std::string, std::string>>;

/// While it lives, every log line of this thread carries the tags that it has no field of its own for. The innermost
/// one counts.
class LogScope {
 public:
  explicit LogScope(LogTags tags);
  ~LogScope();
  LogScope(const LogScope&) = delete;
  LogScope& operator=(const LogScope&) = delete;

 private:
  const LogTags tags_;
  const LogTags* const outer_;
};

/// Log lines go to standard error from here on, one an event: time (UTC), level, event, fields.
void StartLogging(LogFormat format);

/// `event` is a fixed name, as in "session committed"; what varies goes into the fields. Thread-safe.
void LogInfo(std::string_view event, std::initializer_list<LogField> fields = {});
void LogWarning(std::string_view event, std::initializer_list<LogField> fields = {});
void LogError(std::string_view event, std::initializer_list<LogField> fields = {});

}  // namespace mapkeep
