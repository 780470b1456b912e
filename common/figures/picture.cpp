// SPDX-License-Identifier: Apache-2.0
#include "figures/picture.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "base/error.h"
#include "figures/canvas.h"
#include "files/csv_table.h"
#include "files/output_file.h"

namespace af {

namespace {

constexpr Color kPaper{1.0, 1.0, 1.0};
constexpr Color kInk{0.13, 0.13, 0.13};
constexpr Color kFaintInk{0.38, 0.38, 0.38};
constexpr Color kBox{1.0, 0.76, 0.03};
constexpr Color kBoxShadow{0.0, 0.0, 0.0};
constexpr Color kNotFinite{1.0, 0.55, 0.0};

// ---- Colors
// --------------------------------------------------------------------------------------

/// Place of a value in a window, clamped to [0, 1]; an empty window counts as a step.
double window_position(double value, double low, double high) {
  if (high > low) return std::clamp((value - low) / (high - low), 0.0, 1.0);
  return value > low ? 1.0 : 0.0;
}

std::uint32_t byte_of(double part) {
  return static_cast<std::uint32_t>(std::lround(255.0 * part));
}

std::uint32_t packed(const Color& color) {
  return byte_of(color.red) << 16 | byte_of(color.green) << 8 | byte_of(color.blue);
}

Color mixed(const Color& a, const Color& b, double share_of_b) {
  return {std::lerp(a.red, b.red, share_of_b),
          std::lerp(a.green, b.green, share_of_b),
          std::lerp(a.blue, b.blue, share_of_b)};
}

/// Grey from black to white, or blue through white to red (ends as in ColorBrewer's RdBu).
std::uint32_t color_of(double position, PicturePanel::Colors colors) {
  if (colors == PicturePanel::Colors::Grey) return 0x010101U * byte_of(position);
  constexpr Color kBlue{0.13, 0.40, 0.67};
  constexpr Color kWhite{1.0, 1.0, 1.0};
  constexpr Color kRed{0.70, 0.09, 0.17};
  return packed(position < 0.5 ? mixed(kBlue, kWhite, 2.0 * position)
                               : mixed(kWhite, kRed, 2.0 * position - 1.0));
}

// ---- Layout
// --------------------------------------------------------------------------------------

constexpr int kMargin = 18;
constexpr int kGap = 22;
constexpr int kSmallGap = 6;
constexpr int kBarHeight = 8;
constexpr int kMinCellWidth = 180;

struct Layout {
  int cell_width = kMinCellWidth;
  Font heading, title, caption, scale;
};

Layout layout_of(const std::vector<PicturePanel>& panels, int zoom) {
  Layout layout;
  for (const PicturePanel& panel : panels)
    layout.cell_width = std::max(layout.cell_width, panel.image.width * zoom);
  // Letters grow with the panels, so that a picture scaled to fit a page stays readable.
  const double size = std::clamp(layout.cell_width / 32.0, 12.0, 30.0);
  layout.heading = {std::round(1.35 * size), true};
  layout.title = {std::round(1.1 * size), true};
  layout.caption = {std::round(size), false};
  layout.scale = {std::round(0.9 * size), false};
  return layout;
}

/// One panel's texts broken into lines.
struct PanelText {
  std::vector<std::string> title;
  std::vector<std::string> caption;
};

/// One row of the grid and the heights that its tallest panels need.
struct PanelRow {
  std::size_t first = 0, count = 0;
  int title_height = 0, image_height = 0, caption_height = 0;

  [[nodiscard]] int height(const Layout& layout) const {
    const int scale = kSmallGap + kBarHeight + static_cast<int>(layout.scale.line_height_px());
    return title_height + image_height + scale + kSmallGap + caption_height;
  }
};

int lines_height(const std::vector<std::string>& lines, const Font& font) {
  return static_cast<int>(static_cast<double>(lines.size()) * font.line_height_px());
}

std::vector<PanelRow> rows_of(const std::vector<PicturePanel>& panels,
                              const std::vector<PanelText>& texts,
                              const Layout& layout,
                              int columns,
                              int zoom) {
  std::vector<PanelRow> rows;
  const auto step = static_cast<std::size_t>(columns);
  for (std::size_t first = 0; first < panels.size(); first += step) {
    PanelRow row{first, std::min(step, panels.size() - first)};
    for (std::size_t i = first; i < first + row.count; ++i) {
      const int title = lines_height(texts[i].title, layout.title);
      row.title_height = std::max(row.title_height, title > 0 ? title + kSmallGap : 0);
      row.image_height = std::max(row.image_height, panels[i].image.height * zoom);
      row.caption_height =
          std::max(row.caption_height, lines_height(texts[i].caption, layout.caption));
    }
    rows.push_back(row);
  }
  return rows;
}

// ---- Drawing
// -------------------------------------------------------------------------------------

Color color_of(PictureColor color) {
  switch (color) {
    case PictureColor::Ink:
      return kInk;
    case PictureColor::Cyan:
      return {0.2, 0.85, 1.0};
    case PictureColor::Red:
      return {0.86, 0.15, 0.15};
    case PictureColor::Green:
      return {0.1, 0.6, 0.25};
    case PictureColor::Yellow:
      break;
  }
  return kBox;
}

/// Letters with a dark rim, so that they stand out on black and on white.
void draw_rimmed_text(Canvas& canvas,
                      double x,
                      double baseline_y,
                      const std::string& text,
                      const Font& font,
                      PictureColor color) {
  if (color != PictureColor::Ink)
    for (const auto& [dx, dy] : {std::pair{-1.2, 0.0}, {1.2, 0.0}, {0.0, -1.2}, {0.0, 1.2}})
      canvas.text(x + dx, baseline_y + dy, text, font, kBoxShadow);
  canvas.text(x, baseline_y, text, font, color_of(color));
}

/// `right` is where the panel ends. A text that would reach beyond it is put left of its mark.
void draw_mark(
    Canvas& canvas, const PictureMark& mark, double x, double y, double size, double right) {
  const Color color = color_of(mark.color);
  const Area around = {static_cast<int>(x - 2.0 * size),
                       static_cast<int>(y - 2.0 * size),
                       static_cast<int>(4.0 * size),
                       static_cast<int>(4.0 * size)};
  switch (mark.shape) {
    case PictureMark::Shape::Cross:
      canvas.lines({{x - size, y - size}, {x + size, y + size}}, around, color, 1.8);
      canvas.lines({{x - size, y + size}, {x + size, y - size}}, around, color, 1.8);
      break;
    case PictureMark::Shape::Circle:
      canvas.circle(x, y, 1.2 * size, color, 1.8);
      break;
    case PictureMark::Shape::Dot:
      canvas.circle(x, y, 0.8 * size, color, 0.0);
      break;
    case PictureMark::Shape::None:
    case PictureMark::Shape::Label: {
      const bool is_large = mark.shape == PictureMark::Shape::None;
      const Font font{std::round(is_large ? 4.0 * size : std::max(11.0, 2.4 * size)), is_large};
      draw_rimmed_text(canvas,
                       x - canvas.text_width(mark.text, font) / 2.0,
                       y + 0.36 * font.size_px,
                       mark.text,
                       font,
                       mark.color);
      return;
    }
  }
  if (mark.text.empty()) return;
  const Font font{std::round(2.6 * size), true};
  const double width = canvas.text_width(mark.text, font);
  const double beside = 1.6 * size;
  const bool fits = x + beside + width <= right;
  draw_rimmed_text(
      canvas, fits ? x + beside : x - beside - width, y - 0.8 * size, mark.text, font, mark.color);
}

/// Lines and marks over a panel's image, which fills the area.
void draw_marks(Canvas& canvas, const PicturePanel& panel, const Area& area, int zoom) {
  const auto placed = [&](const std::array<double, 2>& place) {
    return std::array<double, 2>{area.x + (place[0] + 0.5) * zoom,
                                 area.y + (place[1] + 0.5) * zoom};
  };
  for (const PictureLine& line : panel.lines) {
    std::vector<std::array<double, 2>> points;
    points.reserve(line.points.size());
    for (const auto& point : line.points) points.push_back(placed(point));
    canvas.lines(points, area, color_of(line.color), line.width_px);
  }
  const double size = std::clamp(area.width / 90.0, 3.0, 9.0);
  for (const PictureMark& mark : panel.marks) {
    const auto [x, y] = placed(mark.place);
    draw_mark(canvas, mark, x, y, size, area.x + area.width);
  }
}

void draw_image(Canvas& canvas, const PicturePanel& panel, int x0, int y0, int zoom) {
  canvas.set_pixels({x0, y0, panel.image.width * zoom, panel.image.height * zoom},
                    [&](int x, int y) {
                      const double value = static_cast<double>(panel.image.at(x / zoom, y / zoom));
                      if (!std::isfinite(value)) return packed(kNotFinite);
                      return color_of(window_position(value, panel.low, panel.high), panel.colors);
                    });
  for (const RegionOfInterest& box : panel.boxes) {
    const double x = x0 + box.column * zoom, y = y0 + box.row * zoom;
    const double width = box.width * zoom, height = box.height * zoom;
    canvas.outline(x, y, width, height, kBoxShadow, 3.5);
    canvas.outline(x, y, width, height, kBox, 1.8);
  }
  draw_marks(canvas, panel, {x0, y0, panel.image.width * zoom, panel.image.height * zoom}, zoom);
  canvas.outline(x0 - 0.5,
                 y0 - 0.5,
                 panel.image.width * zoom + 1,
                 panel.image.height * zoom + 1,
                 kFaintInk,
                 1.0);
}

/// The window as a bar of its colors between its two values.
void draw_scale(
    Canvas& canvas, const PicturePanel& panel, int x0, int y0, int width, const Font& font) {
  canvas.set_pixels({x0, y0, width, kBarHeight}, [&](int x, int) {
    return color_of(width > 1 ? static_cast<double>(x) / (width - 1) : 0.5, panel.colors);
  });
  canvas.outline(x0 - 0.5, y0 - 0.5, width + 1, kBarHeight + 1, kFaintInk, 1.0);
  // Both ends get the same decimals, enough to tell a hundredth of the window.
  const double span = std::abs(panel.high - panel.low);
  const int decimals = span > 0.0 && std::isfinite(span)
                           ? std::clamp(2 - static_cast<int>(std::floor(std::log10(span))), 0, 9)
                           : 3;
  const auto short_text = [decimals](double value) {
    const std::string exact = number_text(value);
    const std::string rounded = std::isfinite(value) ? fixed_text(value, decimals) : exact;
    return exact.size() < rounded.size() ? exact : rounded;
  };
  const double baseline = y0 + kBarHeight + 3 + font.size_px;
  const std::string high = short_text(panel.high);
  canvas.text(x0, baseline, short_text(panel.low), font, kFaintInk);
  canvas.text(x0 + width - canvas.text_width(high, font), baseline, high, font, kFaintInk);
}

void draw_row(Canvas& canvas,
              const std::vector<PicturePanel>& panels,
              const std::vector<PanelText>& texts,
              const PanelRow& row,
              const Layout& layout,
              int y,
              int zoom) {
  for (std::size_t i = 0; i < row.count; ++i) {
    const PicturePanel& panel = panels[row.first + i];
    const PanelText& text = texts[row.first + i];
    const int x = kMargin + static_cast<int>(i) * (layout.cell_width + kGap);
    // Titles stand directly above their image, however many lines the neighbours' titles need.
    const int title_height = lines_height(text.title, layout.title) + kSmallGap;
    const int image_y = y + row.title_height;
    draw_lines(canvas, text.title, x, image_y - title_height, layout.title, kInk);
    draw_image(canvas, panel, x, image_y, zoom);
    const int bar_y = image_y + panel.image.height * zoom + kSmallGap;
    const int bar_width = std::max(panel.image.width * zoom, kMinCellWidth / 2);
    if (panel.has_scale) draw_scale(canvas, panel, x, bar_y, bar_width, layout.scale);
    const double caption_y = bar_y + kBarHeight + layout.scale.line_height_px() + kSmallGap;
    draw_lines(canvas, text.caption, x, caption_y, layout.caption, kInk);
  }
}

void check_panels(const std::vector<PicturePanel>& panels, int columns, int zoom) {
  check(!panels.empty(), "write_picture needs a panel");
  check(columns > 0 && zoom > 0, "write_picture needs positive columns and zoom");
  for (const PicturePanel& panel : panels) {
    const Image2d& image = panel.image;
    check(image.width > 0 && image.height > 0, "write_picture needs images that are not empty");
    check(image.pixels.size() ==
              static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height),
          "an image's size and pixels differ");
  }
}

/// Refuses pictures that cairo or memory could not hold. Computes in 64 bits, because zoomed sizes
/// may overflow an int.
void check_size(const std::vector<PicturePanel>& panels, int columns, int zoom) {
  constexpr std::int64_t kMaxSide = 30000;
  constexpr std::int64_t kMaxArea = 400'000'000;
  std::int64_t width = 0;
  std::int64_t height = 0;
  for (const PicturePanel& panel : panels) {
    width = std::max(width, std::int64_t{panel.image.width} * zoom);
    height = std::max(height, std::int64_t{panel.image.height} * zoom);
  }
  const auto count = static_cast<std::int64_t>(panels.size());
  const std::int64_t rows = (count + columns - 1) / columns;
  width = (std::max<std::int64_t>(width, kMinCellWidth) + kGap) *
          std::min<std::int64_t>(columns, count);
  height *= rows;
  if (width > kMaxSide || height > kMaxSide || width * height > kMaxArea)
    throw InputError("picture size",
                     std::to_string(width) + " x " + std::to_string(height) + " pixels",
                     "must be within 30000 pixels on a side and 4e8 in all");
}

}  // namespace

void write_picture(const std::vector<PicturePanel>& panels,
                   int columns,
                   const std::string& heading,
                   const std::filesystem::path& path,
                   int zoom) {
  check_panels(panels, columns, zoom);
  columns = std::min(columns, static_cast<int>(panels.size()));
  check_size(panels, columns, zoom);
  const Layout layout = layout_of(panels, zoom);
  const int inner_width = columns * layout.cell_width + (columns - 1) * kGap;

  Canvas measure(1, 1);
  const auto heading_lines = wrapped(measure, heading, layout.heading, inner_width);
  std::vector<PanelText> texts;
  texts.reserve(panels.size());
  for (const PicturePanel& panel : panels)
    texts.push_back({wrapped(measure, panel.title, layout.title, layout.cell_width),
                     wrapped(measure, panel.caption, layout.caption, layout.cell_width)});
  const auto rows = rows_of(panels, texts, layout, columns, zoom);

  int y = kMargin + lines_height(heading_lines, layout.heading);
  if (!heading_lines.empty()) y += 2 * kSmallGap;
  int height = y + kMargin - kGap;
  for (const PanelRow& row : rows) height += row.height(layout) + kGap;

  Canvas canvas(inner_width + 2 * kMargin, height);
  canvas.fill(kPaper);
  draw_lines(canvas, heading_lines, kMargin, kMargin, layout.heading, kInk);
  for (const PanelRow& row : rows) {
    draw_row(canvas, panels, texts, row, layout, y, zoom);
    y += row.height(layout) + kGap;
  }
  write_text_file(path, canvas.png());
}

Image2d checkerboard(const Image2d& a, const Image2d& b, int field_px) {
  check(a.width == b.width && a.height == b.height, "checkerboard() needs images of one size");
  check(field_px > 0, "checkerboard() needs fields of at least one pixel");
  const auto [a_low, a_high] = percentile_window(a);
  const auto [b_low, b_high] = percentile_window(b);
  Image2d board(a.width, a.height);
  for (int row = 0; row < a.height; ++row)
    for (int column = 0; column < a.width; ++column) {
      const bool shows_a = (row / field_px + column / field_px) % 2 == 0;
      const double value = static_cast<double>((shows_a ? a : b).at(column, row));
      board.at(column, row) = static_cast<float>(shows_a ? window_position(value, a_low, a_high)
                                                         : window_position(value, b_low, b_high));
    }
  return board;
}

std::array<double, 2> percentile_window(const Image2d& image,
                                        double low_percent,
                                        double high_percent) {
  check(low_percent >= 0.0 && low_percent <= high_percent && high_percent <= 100.0,
        "percentiles must be ordered within 0 and 100");
  std::vector<float> values;
  values.reserve(image.pixels.size());
  std::copy_if(image.pixels.begin(), image.pixels.end(), std::back_inserter(values), [](float v) {
    return std::isfinite(v);
  });
  if (values.empty()) return {0.0, 0.0};
  const auto percentile = [&values](double percent) {
    const double position = percent / 100.0 * static_cast<double>(values.size() - 1);
    const auto below = values.begin() + static_cast<std::ptrdiff_t>(position);
    std::nth_element(values.begin(), below, values.end());
    const double at_below = static_cast<double>(*below);
    if (below + 1 == values.end()) return at_below;
    const double above = static_cast<double>(*std::min_element(below + 1, values.end()));
    return std::lerp(at_below, above, position - std::floor(position));
  };
  return {percentile(low_percent), percentile(high_percent)};
}

}  // namespace af
