#pragma once

#include <absl/status/statusor.h>

#include <cstddef>
#include <string>
#include <string_view>

namespace mapkeep {

/// One zstd frame that knows its content's size. INTERNAL if the library fails.
absl::StatusOr<std::string> Compress(std::string_view bytes, int level);

/// The content of one frame, which must be `size` bytes; DATA_LOSS otherwise. Never allocates more than that.
absl::StatusOr<std::string> Decompress(std::string_view frame, size_t size);

}  // namespace mapkeep
