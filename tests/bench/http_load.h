#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace mapkeep {

/// What a server gave to readers that take all they can get.
struct HttpLoadResult {
  double seconds = 0;
  uint64_t bytes = 0;  ///< of bodies
  uint64_t responses = 0;
};

/// GETs the paths of a server on 127.0.0.1 over keep-alive connections, each going through all of them from another one
/// on, for about `seconds`, on this thread. Throws std::runtime_error for anything but 200.
HttpLoadResult RunHttpLoad(int port, const std::vector<std::string>& paths, int connections, double seconds,
                           const std::string& extra_header = "");

/// One GET; throws likewise.
std::string HttpGet(int port, const std::string& path);

}  // namespace mapkeep
