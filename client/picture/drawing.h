#pragma once

#include <absl/status/status.h>

#include <string>

#include "client/picture/colouring.h"
#include "client/picture/top_view.h"

namespace mapkeep {

/// Writes the view as a PNG, one pixel a cell: shaded from the north-west, metres on both axes, a legend, a title line.
/// RESOURCE_EXHAUSTED if the picture is larger than 32,000 pixels an edge; UNAVAILABLE naming the file if it cannot be
/// written.
absl::Status DrawPicture(const TopView& view, const Colouring& colouring, const std::string& title,
                         const std::string& path);

/// The nearest of 1, 2 or 5 times a power of ten that is at least `wanted`: the step of an axis.
double TickStep(double wanted);

}  // namespace mapkeep
