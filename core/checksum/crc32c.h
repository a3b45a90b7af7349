#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace mapkeep {

/// CRC-32C (Castagnoli, RFC 3720 appendix B.4) of `bytes`, continuing from the checksum of what came before (0 at the
/// start): Crc32c(b, Crc32c(a)) equals Crc32c(a + b).
uint32_t Crc32c(std::string_view bytes, uint32_t before = 0);

}  // namespace mapkeep
