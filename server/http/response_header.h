#pragma once

#include <string>
#include <string_view>

#include "server/http/page.h"

namespace mapkeep {

/// What the header says beside the answer itself.
struct ResponseTerms {
  bool keep_alive = true;
  std::string_view origin;           ///< of the request; empty: none
  std::string_view allowed_origins;  ///< see PageServerOptions
  bool shared_caches = true;
};

/// Status line and fields, with the empty line that ends them.
std::string ResponseHeader(const PageResponse& page, const ResponseTerms& terms);

/// The bytes of the body that are to be sent.
std::string_view BodyOf(const PageResponse& page);

}  // namespace mapkeep
