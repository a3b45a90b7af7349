#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/http/request_target.h"

namespace mapkeep {

class EventStream;

/// A GET or HEAD as the pages see it.
struct PageRequest {
  RequestTarget target;
  std::string token;            ///< of "Authorization: Bearer" or ?token=; empty: none
  std::string accept_encoding;  ///< header fields as they came; empty: absent
  std::string if_none_match;
  std::string range, if_range;
  std::string last_event_id;
};

/// How a client may keep an answer.
enum class Keep : uint8_t {
  kNever,       ///< no-store
  kRevalidate,  ///< ask each time, with the ETag
  kForever,     ///< immutable
};

/// An answer. The body is shared, never copied.
struct PageResponse {
  int status = 200;
  std::string content_type = "application/json";
  std::string content_coding;  ///< "", "gzip" or "zstd"
  std::shared_ptr<const std::string> body = std::make_shared<const std::string>();
  std::string etag;  ///< with its quotes; empty: none
  Keep keep = Keep::kNever;
  std::vector<std::pair<std::string, std::string>> headers;  ///< further ones
  std::pair<size_t, size_t> part{0, SIZE_MAX};               ///< of the body: first byte, and how many
  std::shared_ptr<EventStream> events;                       ///< set: after the header comes whatever it gives
};

/// Called once, from any thread.
using Respond = std::function<void(PageResponse)>;

/// {"error": {"code": "NOT_FOUND", "message": "..."}} with the HTTP status that belongs to the code.
PageResponse ErrorPage(const absl::Status& status);
PageResponse ErrorPage(int http_status, const std::string& code, const std::string& message);

}  // namespace mapkeep
