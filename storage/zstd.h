#pragma once

#include <absl/status/statusor.h>

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace mapkeep {

/// Bytes in parts of different statistics, such as columns.
struct Parts {
  std::string bytes;
  std::vector<size_t> ends;  ///< of each part, ascending; the last is bytes.size()

  /// Ends a part here, unless it is empty.
  void Cut() {
    if (ends.empty() ? !bytes.empty() : ends.back() < bytes.size()) ends.push_back(bytes.size());
  }
};

/// One zstd frame that knows its content's size. Each part begins a block of the frame, and so has an entropy code of
/// its own: a tenth less than one code for all columns of a map's block. INTERNAL if the library fails.
absl::StatusOr<std::string> Compress(const Parts& parts, int level);

/// The content of one frame, which must be `size` bytes; DATA_LOSS otherwise. Never allocates more than that.
absl::StatusOr<std::string> Decompress(std::string_view frame, size_t size);

}  // namespace mapkeep
