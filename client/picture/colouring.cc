#include "client/picture/colouring.h"

#include <algorithm>
#include <cmath>

namespace mapkeep {
namespace {

constexpr Rgb kGroundColour{0.62, 0.58, 0.50};
constexpr Rgb kStructureColour{0.16, 0.42, 0.62};
constexpr double kMinutesPerDay = 24 * 60;

double Percentile(std::vector<double>& values, double share) {
  const auto nth = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

}  // namespace

Rgb RampColour(double share) {
  // Lightness rises steadily along the ramp, so that it also reads in grey.
  static constexpr std::array<Rgb, 6> kStops{{{0.19, 0.10, 0.36},
                                              {0.20, 0.27, 0.56},
                                              {0.13, 0.47, 0.56},
                                              {0.17, 0.66, 0.47},
                                              {0.58, 0.82, 0.27},
                                              {0.98, 0.91, 0.36}}};
  const double position = std::clamp(share, 0.0, 1.0) * (kStops.size() - 1);
  const size_t below = std::min(static_cast<size_t>(position), kStops.size() - 2);
  const double rest = position - static_cast<double>(below);
  Rgb colour;
  for (int c = 0; c < 3; ++c) colour[c] = kStops[below][c] * (1 - rest) + kStops[below + 1][c] * rest;
  return colour;
}

Colouring ColouringOf(const TopView& view, PictureColour by) {
  Colouring colouring{.by = by};
  std::vector<double> heights;
  uint32_t newest = 0, oldest = UINT32_MAX;
  for (const TopView::Cell& cell : view.cells) {
    if (!cell.occupied) continue;
    heights.push_back(cell.z);
    newest = std::max(newest, cell.last_seen);
    oldest = std::min(oldest, cell.last_seen);
  }
  switch (by) {
    case PictureColour::kHeight:
      colouring.title = "height (m)";
      if (!heights.empty()) {
        colouring.low = Percentile(heights, 0.01);
        colouring.high = std::max(Percentile(heights, 0.99), colouring.low + 0.1);
      }
      break;
    case PictureColour::kStability:
      colouring.title = "stability R";
      break;
    case PictureColour::kGround:
      colouring.title = "ground";
      colouring.classes = {{kGroundColour, "ground"}, {kStructureColour, "not ground"}};
      break;
    case PictureColour::kAge:
      // Values are days since 2000; the legend counts back from the newest.
      colouring.title = "last seen (days before the newest)";
      colouring.high = newest / kMinutesPerDay;
      colouring.low = std::min(oldest, newest) / kMinutesPerDay;
      if (colouring.low == colouring.high) colouring.low -= 1;
      break;
  }
  return colouring;
}

double ValueOf(const TopView::Cell& cell, const Colouring& colouring) {
  switch (colouring.by) {
    case PictureColour::kStability:
      return cell.stability;
    case PictureColour::kAge:
      return cell.last_seen / kMinutesPerDay;
    case PictureColour::kHeight:
    case PictureColour::kGround:
      break;
  }
  return cell.z;
}

Rgb ColourOf(const TopView::Cell& cell, const Colouring& colouring) {
  if (colouring.by == PictureColour::kGround) return cell.ground ? kGroundColour : kStructureColour;
  return RampColour((ValueOf(cell, colouring) - colouring.low) / (colouring.high - colouring.low));
}

}  // namespace mapkeep
