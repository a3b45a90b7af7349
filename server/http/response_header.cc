#include "server/http/response_header.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>

#include <boost/beast/http/status.hpp>

#include "storage/text.h"

namespace mapkeep {
namespace {

const char* CacheControl(Keep keep, bool shared) {
  switch (keep) {
    case Keep::kForever:
      return shared ? "public, max-age=31536000, immutable" : "private, max-age=31536000, immutable";
    case Keep::kRevalidate:
      return shared ? "no-cache" : "private, no-cache";
    case Keep::kNever:
      break;
  }
  return "no-store";
}

bool IsAllowed(std::string_view origin, std::string_view allowed) {
  for (const absl::string_view one : absl::StrSplit(ToAbsl(allowed), ' ')) {
    if (FromAbsl(one) == origin) return true;
  }
  return false;
}

// Which pages of other sites may read the answer.
void AppendCors(const ResponseTerms& terms, std::string& header) {
  if (terms.allowed_origins.empty()) return;
  const bool everybody = terms.allowed_origins == "*";
  if (!everybody) header += "Vary: Origin\r\n";
  if (!everybody && (terms.origin.empty() || !IsAllowed(terms.origin, terms.allowed_origins))) return;
  header += Text("Access-Control-Allow-Origin: ", everybody ? std::string_view("*") : terms.origin,
                 "\r\nAccess-Control-Allow-Methods: GET, HEAD, OPTIONS"
                 "\r\nAccess-Control-Allow-Headers: Authorization, Range, If-None-Match, If-Range, Last-Event-ID"
                 "\r\nAccess-Control-Expose-Headers: ETag, Content-Range, Accept-Ranges"
                 "\r\nAccess-Control-Max-Age: 86400\r\n");
}

}  // namespace

std::string_view BodyOf(const PageResponse& page) {
  return std::string_view(*page.body).substr(page.part.first, page.part.second);
}

std::string ResponseHeader(const PageResponse& page, const ResponseTerms& terms) {
  const auto reason = boost::beast::http::obsolete_reason(boost::beast::http::int_to_status(page.status));
  std::string header = Text("HTTP/1.1 ", page.status, " ", std::string_view(reason.data(), reason.size()), "\r\n");
  if (!page.content_type.empty() && page.status != 304) header += Text("Content-Type: ", page.content_type, "\r\n");
  if (!page.content_coding.empty()) header += Text("Content-Encoding: ", page.content_coding, "\r\n");
  if (page.status != 304 && page.status != 204 && !page.events) {
    header += Text("Content-Length: ", BodyOf(page).size(), "\r\n");
  }
  if (!page.etag.empty()) header += Text("ETag: ", page.etag, "\r\n");
  header += Text("Cache-Control: ", CacheControl(page.keep, terms.shared_caches), "\r\n");
  if (page.keep != Keep::kNever) header += "Vary: Accept-Encoding\r\n";
  header += "X-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\n";
  AppendCors(terms, header);
  for (const auto& [name, value] : page.headers) header += Text(name, ": ", value, "\r\n");
  header += terms.keep_alive ? "\r\n" : "Connection: close\r\n\r\n";
  return header;
}

}  // namespace mapkeep
