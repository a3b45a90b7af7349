#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace mapkeep {

/// How a body is packed for the way.
enum class Coding : uint8_t { kIdentity, kGzip, kZstd };

/// The body packed. Fast before small: it happens while a client waits.
std::string Packed(std::string_view body, Coding coding);

}  // namespace mapkeep
