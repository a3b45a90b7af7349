#include "client/picture/drawing.h"

#include <absl/strings/str_format.h>
#include <cairo/cairo.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>

namespace mapkeep {
namespace {

constexpr int kLargestEdge = 32000;  // a cairo image surface ends at 32,767
constexpr int kLeft = 64, kTop = 40, kBottom = 48, kRight = 150, kLeastHeight = 220;
constexpr double kFontSize = 13;

using Surface = std::unique_ptr<cairo_surface_t, decltype(&cairo_surface_destroy)>;
using Context = std::unique_ptr<cairo_t, decltype(&cairo_destroy)>;

// Brightness of a cell from the slope of the surface around it, lit from the north-west at 45 degrees.
double ShadeOf(const TopView& view, int column, int row) {
  const TopView::Cell& here = view.At(column, row);
  const auto height_at = [&](int c, int r) {
    if (c < 0 || r < 0 || c >= view.width || r >= view.height || !view.At(c, r).occupied) return here.z;
    return view.At(c, r).z;
  };
  const double step = 2 * view.cell_size;
  const double dx = std::clamp((height_at(column + 1, row) - height_at(column - 1, row)) / step, -3.0, 3.0);
  const double dy = std::clamp((height_at(column, row + 1) - height_at(column, row - 1)) / step, -3.0, 3.0);
  const double light = (dx - dy + std::sqrt(2.0)) / (2 * std::sqrt(1 + dx * dx + dy * dy));
  return std::clamp(0.55 + 0.45 * light / 0.7071, 0.35, 1.15);
}

Surface DrawCells(const TopView& view, const Colouring& colouring) {
  Surface image(cairo_image_surface_create(CAIRO_FORMAT_RGB24, view.width, view.height), cairo_surface_destroy);
  if (cairo_surface_status(image.get()) != CAIRO_STATUS_SUCCESS) return image;
  cairo_surface_flush(image.get());
  unsigned char* data = cairo_image_surface_get_data(image.get());
  const int stride = cairo_image_surface_get_stride(image.get());
  for (int row = 0; row < view.height; ++row) {
    auto* line = reinterpret_cast<uint32_t*>(data + static_cast<size_t>(view.height - 1 - row) * stride);
    for (int column = 0; column < view.width; ++column) {
      const TopView::Cell& cell = view.At(column, row);
      line[column] = 0xffffff;
      if (!cell.occupied) continue;
      const Rgb colour = ColourOf(cell, colouring);
      const double shade = ShadeOf(view, column, row);
      uint32_t pixel = 0;
      for (const double channel : colour) {
        pixel = pixel << 8 | static_cast<uint32_t>(std::lround(std::clamp(channel * shade, 0.0, 1.0) * 255));
      }
      line[column] = pixel;
    }
  }
  cairo_surface_mark_dirty(image.get());
  return image;
}

enum class Align { kLeft, kCentre, kRight };

void Text(cairo_t* to, double x, double y, const std::string& text, Align align = Align::kLeft) {
  cairo_text_extents_t extents;
  cairo_text_extents(to, text.c_str(), &extents);
  const double shift = align == Align::kLeft ? 0 : align == Align::kCentre ? extents.x_advance / 2 : extents.x_advance;
  cairo_move_to(to, x - shift, y);
  cairo_show_text(to, text.c_str());
}

void Line(cairo_t* to, double x0, double y0, double x1, double y1) {
  cairo_move_to(to, x0, y0);
  cairo_line_to(to, x1, y1);
  cairo_stroke(to);
}

void DrawAxes(cairo_t* to, const TopView& view) {
  cairo_set_source_rgb(to, 0.15, 0.15, 0.15);
  cairo_set_line_width(to, 1);
  cairo_rectangle(to, kLeft - 0.5, kTop - 0.5, view.width + 1, view.height + 1);
  cairo_stroke(to);
  const double step = TickStep(80 * view.cell_size);
  const auto first = [&](double low) { return std::ceil(low / step) * step; };
  const double right = view.corner.x() + view.width * view.cell_size;
  for (double x = first(view.corner.x()); x <= right; x += step) {
    const double at = kLeft + std::floor((x - view.corner.x()) / view.cell_size) + 0.5;
    Line(to, at, kTop + view.height, at, kTop + view.height + 5);
    Text(to, at, kTop + view.height + 19, absl::StrFormat("%g", x), Align::kCentre);
  }
  const double top = view.corner.y() + view.height * view.cell_size;
  for (double y = first(view.corner.y()); y <= top; y += step) {
    const double at = kTop + view.height - std::floor((y - view.corner.y()) / view.cell_size) - 0.5;
    Line(to, kLeft - 5, at, kLeft, at);
    Text(to, kLeft - 8, at + 4, absl::StrFormat("%g", y), Align::kRight);
  }
  Text(to, kLeft + view.width / 2.0, kTop + view.height + 38, "x (m)", Align::kCentre);
  Text(to, 8, kTop - 12, "y (m)");
}

void DrawLegend(cairo_t* to, const TopView& view, const Colouring& colouring) {
  const double x = kLeft + view.width + 18;
  if (!colouring.classes.empty()) {
    double y = kTop + 4;
    for (const LegendEntry& entry : colouring.classes) {
      cairo_set_source_rgb(to, entry.colour[0], entry.colour[1], entry.colour[2]);
      cairo_rectangle(to, x, y, 14, 14);
      cairo_fill(to);
      cairo_set_source_rgb(to, 0.15, 0.15, 0.15);
      Text(to, x + 22, y + 12, entry.label);
      y += 24;
    }
    return;
  }
  constexpr int kBar = 150;
  const double top = kTop + 4;
  for (int i = 0; i < kBar; ++i) {
    const Rgb colour = RampColour(1 - (i + 0.5) / kBar);
    cairo_set_source_rgb(to, colour[0], colour[1], colour[2]);
    cairo_rectangle(to, x, top + i, 16, 1.5);
    cairo_fill(to);
  }
  cairo_set_source_rgb(to, 0.15, 0.15, 0.15);
  for (int i = 0; i <= 4; ++i) {
    double value = colouring.low + (colouring.high - colouring.low) * i / 4;
    if (colouring.by == PictureColour::kAge) value = colouring.high - value;
    const double y = top + kBar * (1 - i / 4.0);
    Line(to, x + 16, y, x + 20, y);
    Text(to, x + 25, y + 4, absl::StrFormat("%.3g", value));
  }
}

}  // namespace

double TickStep(double wanted) {
  const double power = std::pow(10, std::floor(std::log10(wanted)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= wanted * (1 - 1e-9)) return factor * power;
  }
  return 10 * power;
}

absl::Status DrawPicture(const TopView& view, const Colouring& colouring, const std::string& title,
                         const std::string& path) {
  const int width = kLeft + view.width + kRight;
  const int height = std::max(kTop + view.height + kBottom, kLeastHeight);
  if (width > kLargestEdge || height > kLargestEdge) {
    return absl::ResourceExhaustedError(
        absl::StrFormat("the picture would have %d x %d pixels; at most %d an edge, so ask for fewer pixels a metre",
                        width, height, kLargestEdge));
  }
  const Surface cells = DrawCells(view, colouring);
  const Surface page(cairo_image_surface_create(CAIRO_FORMAT_RGB24, width, height), cairo_surface_destroy);
  const Context context(cairo_create(page.get()), cairo_destroy);
  cairo_t* to = context.get();
  cairo_set_source_rgb(to, 1, 1, 1);
  cairo_paint(to);
  cairo_set_source_surface(to, cells.get(), kLeft, kTop);
  cairo_paint(to);
  cairo_select_font_face(to, "DejaVu Sans", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(to, kFontSize);
  DrawAxes(to, view);
  DrawLegend(to, view, colouring);
  Text(to, kLeft, 18, title);
  Text(to, kLeft + view.width + kRight - 8, kTop - 12, colouring.title, Align::kRight);
  if (const cairo_status_t drawn = cairo_status(to); drawn != CAIRO_STATUS_SUCCESS) {
    return absl::ResourceExhaustedError(
        absl::StrFormat("the picture cannot be drawn: %s", cairo_status_to_string(drawn)));
  }
  const std::string unfinished = path + ".part";
  const cairo_status_t written = cairo_surface_write_to_png(page.get(), unfinished.c_str());
  if (written != CAIRO_STATUS_SUCCESS || std::rename(unfinished.c_str(), path.c_str()) != 0) {
    std::remove(unfinished.c_str());
    return absl::UnavailableError(absl::StrFormat("cannot write %s: %s", path, cairo_status_to_string(written)));
  }
  return absl::OkStatus();
}

}  // namespace mapkeep
