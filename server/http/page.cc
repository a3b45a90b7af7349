#include "server/http/page.h"

#include <nlohmann/json.hpp>

namespace mapkeep {
namespace {

int HttpStatusOf(absl::StatusCode code) {
  switch (code) {
    case absl::StatusCode::kInvalidArgument:
    case absl::StatusCode::kOutOfRange:
      return 400;
    case absl::StatusCode::kUnauthenticated:
      return 401;
    case absl::StatusCode::kPermissionDenied:
      return 403;
    case absl::StatusCode::kNotFound:
      return 404;
    case absl::StatusCode::kFailedPrecondition:
    case absl::StatusCode::kAborted:
    case absl::StatusCode::kAlreadyExists:
      return 409;
    case absl::StatusCode::kResourceExhausted:
      return 429;
    case absl::StatusCode::kUnimplemented:
      return 501;
    case absl::StatusCode::kUnavailable:
      return 503;
    case absl::StatusCode::kDeadlineExceeded:
      return 504;
    default:
      return 500;
  }
}

}  // namespace

PageResponse ErrorPage(const absl::Status& status) {
  return ErrorPage(HttpStatusOf(status.code()), absl::StatusCodeToString(status.code()), std::string(status.message()));
}

PageResponse ErrorPage(int http_status, const std::string& code, const std::string& message) {
  PageResponse page{.status = http_status};
  const nlohmann::json json = {{"error", {{"code", code}, {"message", message}}}};
  page.body =
      std::make_shared<const std::string>(json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
  if (http_status == 503 || http_status == 429) page.headers.emplace_back("Retry-After", "1");
  return page;
}

}  // namespace mapkeep
