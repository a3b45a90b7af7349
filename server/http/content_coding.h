#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "server/http/page.h"
#include "server/tiles/packing.h"

namespace mapkeep {

/// "", "gzip", "zstd".
std::string NameOf(Coding coding);

/// The best coding that an Accept-Encoding field allows: zstd before gzip before none, none if there is no field.
Coding BestCoding(std::string_view accept_encoding);

/// The ETag of a representation: `name` says what it is, whatever its coding.
std::string EntityTag(std::string_view name, Coding coding);

/// Whether an If-None-Match or If-Range field names this ETag.
bool NamesTag(std::string_view field, std::string_view etag);

/// Turns a whole answer of identity coding into what the request's Range asks for: 206 with that part, 416, or the
/// whole if there is no range, more than one, or If-Range names another state.
void ApplyRange(const PageRequest& request, PageResponse& page);

}  // namespace mapkeep
