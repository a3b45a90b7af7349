#pragma once

#include <string>

namespace mapkeep {

/// What a server answered; status -1: nothing. Apart from the rest: the library's headers leave macros behind that
/// Eigen's do not bear.
struct HttpAnswer {
  int status = -1;
  std::string body;
};

/// GET, as `token` if it is not empty; over TLS if the certificate authority's file is given.
HttpAnswer HttpGet(const std::string& address, const std::string& path, const std::string& token = "",
                   const std::string& authority = "");

/// Status of GET, or -1 if nothing answers.
int HttpStatus(const std::string& address, const std::string& path);

}  // namespace mapkeep
