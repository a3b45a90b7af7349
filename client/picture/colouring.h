#pragma once

#include <array>
#include <string>
#include <vector>

#include "client/picture/top_view.h"

namespace mapkeep {

/// What the colours of a picture mean.
enum class PictureColour { kHeight, kStability, kGround, kAge };

using Rgb = std::array<double, 3>;  ///< [0, 1] a channel

/// One entry of a legend: a value on the colour bar, or a named class.
struct LegendEntry {
  Rgb colour{};
  std::string label;
};

/// How one picture is coloured, fitted to what it shows.
struct Colouring {
  PictureColour by = PictureColour::kHeight;
  std::string title;                 ///< with its unit
  double low = 0, high = 1;          ///< value at either end of the colour bar; outside is clamped
  std::vector<LegendEntry> classes;  ///< kGround: the two classes; otherwise empty and the bar is drawn
};

/// Fits the range: heights from the 1st to the 99th percentile, ages from the newest voxel back.
Colouring ColouringOf(const TopView& view, PictureColour by);

/// The colour on the bar at `share` in [0, 1]: dark blue over green to yellow, even to the eye and to the colour-blind.
Rgb RampColour(double share);

/// The value of a cell on the colour bar: metres, R, or days before the newest voxel.
double ValueOf(const TopView::Cell& cell, const Colouring& colouring);

/// The colour of an occupied cell, before shading.
Rgb ColourOf(const TopView::Cell& cell, const Colouring& colouring);

}  // namespace mapkeep
