#include "core/checksum/crc32c.h"

#include <isa-l/crc.h>

#include <algorithm>
#include <limits>

namespace mapkeep {

uint32_t Crc32c(std::string_view bytes, uint32_t before) {
  // ISA-L works on the bare register: the inversions before and after are the caller's, and a length is an int.
  uint32_t state = ~before;
  while (!bytes.empty()) {
    const size_t length = std::min<size_t>(bytes.size(), std::numeric_limits<int>::max());
    auto* data = reinterpret_cast<unsigned char*>(const_cast<char*>(bytes.data()));  // declared non-const, only read
    state = crc32_iscsi(data, static_cast<int>(length), state);
    bytes.remove_prefix(length);
  }
  return ~state;
}

}  // namespace mapkeep
