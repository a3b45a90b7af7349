#include "tests/integration/http_status.h"

#include <httplib.h>

namespace mapkeep {

HttpAnswer HttpGet(const std::string& address, const std::string& path, const std::string& token,
                   const std::string& authority) {
  httplib::Client client((authority.empty() ? "http://" : "https://") + address);
  if (!authority.empty()) client.set_ca_cert_path(authority.c_str());
  httplib::Headers headers;
  if (!token.empty()) headers.emplace("Authorization", "Bearer " + token);
  const auto result = client.Get(path.c_str(), headers);
  return result ? HttpAnswer{result->status, result->body} : HttpAnswer{};
}

int HttpStatus(const std::string& address, const std::string& path) { return HttpGet(address, path).status; }

}  // namespace mapkeep
