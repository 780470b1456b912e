// SPDX-License-Identifier: Apache-2.0
// Shapes and texts on pixels, drawn by cairo. Internal to figures.
#pragma once

#include <array>
#include <cairo.h>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace af {

struct Color {
  double red, green, blue;
};

struct Font {
  double size_px = 13.0;
  bool bold = false;

  [[nodiscard]] double line_height_px() const { return std::ceil(1.35 * size_px); }
};

/// A rectangle of the picture's pixels.
struct Area {
  int x, y, width, height;
};

/// A cairo image surface with its context.
class Canvas {
 public:
  Canvas(int width, int height);

  void fill(const Color& color);
  void outline(double x, double y, double width, double height, const Color& color, double line);
  /// Strokes lines between points of the picture, within an area.
  void lines(const std::vector<std::array<double, 2>>& points,
             const Area& area,
             const Color& color,
             double width);
  /// A circle, filled where `line` is 0.
  void circle(double x, double y, double radius, const Color& color, double line);
  [[nodiscard]] double text_width(const std::string& text, const Font& font);
  /// `baseline_y` is where the letters stand.
  void text(
      double x, double baseline_y, const std::string& text, const Font& font, const Color& color);
  /// Sets single pixels. `color_at(x, y)` gives 0xRRGGBB, where x and y count from the area's
  /// corner.
  void set_pixels(const Area& area, const std::function<std::uint32_t(int, int)>& color_at);
  /// The content of a PNG file.
  [[nodiscard]] std::string png();

 private:
  struct Destroy {
    void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
    void operator()(cairo_t* context) const { cairo_destroy(context); }
  };

  void set_color(const Color& color);
  void set_font(const Font& font);
  void check_status() const;

  std::unique_ptr<cairo_surface_t, Destroy> surface_;
  std::unique_ptr<cairo_t, Destroy> context_;
};

/// Breaks a text into lines of at most `width` px: at blanks, at line feeds, and inside words that
/// are longer than a line. Bytes that are not UTF-8 become '?'.
std::vector<std::string> wrapped(Canvas& canvas,
                                 const std::string& text,
                                 const Font& font,
                                 double width);

/// Draws lines below `y`, and returns where they end.
double draw_lines(Canvas& canvas,
                  const std::vector<std::string>& lines,
                  double x,
                  double y,
                  const Font& font,
                  const Color& color);

}  // namespace af
