#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <string>
#include <string_view>

#include "core/geometry/scan.h"

namespace mapkeep {

/// See EncodePayload; `step` in metres.
absl::StatusOr<std::string> EncodeDraco(const Scan& scan, double step);

/// See DecodePayload.
absl::StatusOr<Scan> DecodeDraco(std::string_view bytes, uint32_t count);

}  // namespace mapkeep
