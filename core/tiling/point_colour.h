#pragma once

#include <array>
#include <cstdint>

namespace mapkeep {

/// A colour by height that needs to know nothing of the rest of the map: a ramp from blue over green to yellow and back
/// every 40 m, lit from above by the normal ({0, 0}: none). sRGB, `height` in metres.
std::array<uint8_t, 3> ColourAt(double height, const std::array<uint8_t, 2>& normal);

}  // namespace mapkeep
