#include "tests/integration/http_status.h"

#include <httplib.h>

namespace mapkeep {

int HttpStatus(const std::string& address, const std::string& path) {
  httplib::Client client("http://" + address);
  const auto result = client.Get(path.c_str());
  return result ? result->status : -1;
}

}  // namespace mapkeep
