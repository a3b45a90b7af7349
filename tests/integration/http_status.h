#pragma once

#include <string>

namespace mapkeep {

/// Status of a GET over HTTP/1.1; -1 if there was no answer. Apart from the rest: the library's headers leave macros
/// behind that Eigen's do not bear.
int HttpStatus(const std::string& address, const std::string& path);

}  // namespace mapkeep
