// SPDX-License-Identifier: Apache-2.0
#include "figures/canvas.h"

#include <algorithm>
#include <cstring>
#include <new>
#include <numbers>
#include <png.h>
#include <stdexcept>
#include <string_view>

#include "base/error.h"

namespace af {

namespace {

/// Bytes of the UTF-8 character at `position`; 0 when it is not valid there.
std::size_t utf8_length(std::string_view text, std::size_t position) {
  const auto byte = [&](std::size_t offset) {
    return static_cast<unsigned char>(text[position + offset]);
  };
  std::size_t length = 0;
  if (byte(0) < 0x80) length = 1;
  if (byte(0) >= 0xC2 && byte(0) < 0xE0) length = 2;
  if (byte(0) >= 0xE0 && byte(0) < 0xF0) length = 3;
  if (byte(0) >= 0xF0 && byte(0) < 0xF5) length = 4;
  if (position + length > text.size()) return 0;
  for (std::size_t i = 1; i < length; ++i)
    if ((byte(i) & 0xC0) != 0x80) return 0;
  if (length == 3 && byte(0) == 0xE0 && byte(1) < 0xA0) return 0;   // overlong
  if (length == 3 && byte(0) == 0xED && byte(1) >= 0xA0) return 0;  // surrogate
  if (length == 4 && byte(0) == 0xF0 && byte(1) < 0x90) return 0;   // overlong
  if (length == 4 && byte(0) == 0xF4 && byte(1) >= 0x90) return 0;  // beyond Unicode
  return length;
}

/// Characters of a text, one string each. Bytes that are not UTF-8 become '?', because cairo would
/// refuse the whole text. Control characters except the line feed become blanks.
std::vector<std::string> characters_of(std::string_view text) {
  std::vector<std::string> characters;
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t length = utf8_length(text, i);
    if (length == 0) {
      characters.emplace_back("?");
    } else {
      const bool is_control = static_cast<unsigned char>(text[i]) < ' ' && text[i] != '\n';
      characters.emplace_back(is_control ? " " : std::string(text.substr(i, length)));
    }
    i += std::max<std::size_t>(length, 1);
  }
  return characters;
}

/// Red, green and blue of a drawn surface, row by row.
std::vector<png_byte> rgb_pixels(cairo_surface_t* surface) {
  const int width = cairo_image_surface_get_width(surface);
  const int height = cairo_image_surface_get_height(surface);
  const std::ptrdiff_t stride = cairo_image_surface_get_stride(surface);
  const unsigned char* data = cairo_image_surface_get_data(surface);
  std::vector<png_byte> rgb;
  rgb.reserve(std::size_t{3} * static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      std::uint32_t color = 0;
      std::memcpy(&color, data + y * stride + std::ptrdiff_t{4} * x, sizeof color);
      for (const int shift : {16, 8, 0}) rgb.push_back(static_cast<png_byte>(color >> shift));
    }
  return rgb;
}

}  // namespace

Canvas::Canvas(int width, int height)
    : surface_(cairo_image_surface_create(CAIRO_FORMAT_RGB24, width, height)),
      context_(cairo_create(surface_.get())) {
  check_status();
}

void Canvas::fill(const Color& color) {
  set_color(color);
  cairo_paint(context_.get());
}

void Canvas::outline(
    double x, double y, double width, double height, const Color& color, double line) {
  set_color(color);
  cairo_set_line_width(context_.get(), line);
  cairo_rectangle(context_.get(), x, y, width, height);
  cairo_stroke(context_.get());
}

void Canvas::lines(const std::vector<std::array<double, 2>>& points,
                   const Area& area,
                   const Color& color,
                   double width) {
  cairo_save(context_.get());
  cairo_rectangle(context_.get(), area.x, area.y, area.width, area.height);
  cairo_clip(context_.get());
  set_color(color);
  cairo_set_line_width(context_.get(), width);
  cairo_new_path(context_.get());
  for (const auto& [x, y] : points) cairo_line_to(context_.get(), x, y);
  cairo_stroke(context_.get());
  cairo_restore(context_.get());
}

void Canvas::circle(double x, double y, double radius, const Color& color, double line) {
  set_color(color);
  cairo_set_line_width(context_.get(), line);
  cairo_new_path(context_.get());
  cairo_arc(context_.get(), x, y, radius, 0.0, 2.0 * std::numbers::pi);
  line > 0.0 ? cairo_stroke(context_.get()) : cairo_fill(context_.get());
}

double Canvas::text_width(const std::string& text, const Font& font) {
  set_font(font);
  cairo_text_extents_t extents;
  cairo_text_extents(context_.get(), text.c_str(), &extents);
  return extents.x_advance;
}

void Canvas::text(
    double x, double baseline_y, const std::string& text, const Font& font, const Color& color) {
  set_font(font);
  set_color(color);
  cairo_move_to(context_.get(), x, baseline_y);
  cairo_show_text(context_.get(), text.c_str());
}

void Canvas::set_pixels(const Area& area, const std::function<std::uint32_t(int, int)>& color_at) {
  cairo_surface_flush(surface_.get());
  unsigned char* data = cairo_image_surface_get_data(surface_.get());
  const int stride = cairo_image_surface_get_stride(surface_.get());
  for (int y = 0; y < area.height; ++y) {
    unsigned char* row =
        data + static_cast<std::ptrdiff_t>(area.y + y) * stride + std::ptrdiff_t{4} * area.x;
    for (int x = 0; x < area.width; ++x) {
      const std::uint32_t color = color_at(x, y);
      std::memcpy(row + std::ptrdiff_t{4} * x, &color, sizeof color);
    }
  }
  cairo_surface_mark_dirty(surface_.get());
}

std::string Canvas::png() {
  check_status();
  cairo_surface_flush(surface_.get());
  png_image image = {};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(cairo_image_surface_get_width(surface_.get()));
  image.height = static_cast<png_uint_32>(cairo_image_surface_get_height(surface_.get()));
  image.format = PNG_FORMAT_RGB;
  // The best compression takes three times as long for files that are a fifth smaller.
  image.flags = PNG_IMAGE_FLAG_FAST;
  const std::vector<png_byte> pixels = rgb_pixels(surface_.get());
  png_alloc_size_t length = PNG_IMAGE_PNG_SIZE_MAX(image);
  std::string bytes(length, '\0');
  if (png_image_write_to_memory(&image, bytes.data(), &length, 0, pixels.data(), 0, nullptr) == 0)
    throw std::runtime_error(std::string("libpng: ") + image.message);
  bytes.resize(length);
  return bytes;
}

void Canvas::set_color(const Color& color) {
  cairo_set_source_rgb(context_.get(), color.red, color.green, color.blue);
}

void Canvas::set_font(const Font& font) {
  cairo_select_font_face(context_.get(),
                         "DejaVu Sans",
                         CAIRO_FONT_SLANT_NORMAL,
                         font.bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(context_.get(), font.size_px);
}

void Canvas::check_status() const {
  const cairo_status_t status = cairo_status(context_.get());
  if (status == CAIRO_STATUS_NO_MEMORY) throw std::bad_alloc();
  check(status == CAIRO_STATUS_SUCCESS, cairo_status_to_string(status));
}

std::vector<std::string> wrapped(Canvas& canvas,
                                 const std::string& text,
                                 const Font& font,
                                 double width) {
  std::vector<std::string> lines;
  if (text.empty()) return lines;
  std::string line;
  std::size_t last_blank = std::string::npos;
  for (const std::string& character : characters_of(text)) {
    if (character == "\n") {
      lines.push_back(line);
      line.clear();
      last_blank = std::string::npos;
      continue;
    }
    if (character == " ") last_blank = line.size();
    line += character;
    if (line == character || character == " " || canvas.text_width(line, font) <= width) continue;
    const bool at_blank = last_blank != std::string::npos;
    const std::size_t cut = at_blank ? last_blank : line.size() - character.size();
    lines.push_back(line.substr(0, cut));
    line = line.substr(cut + (at_blank ? 1 : 0));
    last_blank = std::string::npos;
  }
  lines.push_back(line);
  return lines;
}

double draw_lines(Canvas& canvas,
                  const std::vector<std::string>& lines,
                  double x,
                  double y,
                  const Font& font,
                  const Color& color) {
  for (const std::string& line : lines) {
    canvas.text(x, y + font.size_px, line, font, color);
    y += font.line_height_px();
  }
  return y;
}

}  // namespace af
