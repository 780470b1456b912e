// SPDX-License-Identifier: Apache-2.0
#include "figures/picture.h"

#include <cairo.h>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "support/file_size_limit.h"
#include "support/io_checks.h"

namespace af {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr std::uint32_t kOrange = 0xFF8C00;

Image2d ramp(int width, int height) {
  Image2d image(width, height);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) image.pixels[i] = static_cast<float>(i);
  return image;
}

/// A PNG's pixels as 0xRRGGBB.
struct Pixels {
  int width = 0, height = 0;
  std::vector<std::uint32_t> colors;

  explicit Pixels(const std::filesystem::path& path) {
    cairo_surface_t* surface = cairo_image_surface_create_from_png(path.c_str());
    EXPECT_EQ(cairo_surface_status(surface), CAIRO_STATUS_SUCCESS);
    width = cairo_image_surface_get_width(surface);
    height = cairo_image_surface_get_height(surface);
    const unsigned char* data = cairo_image_surface_get_data(surface);
    const int stride = cairo_image_surface_get_stride(surface);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        const unsigned char* pixel = data + std::ptrdiff_t{stride} * y + std::ptrdiff_t{4} * x;
        colors.push_back(static_cast<std::uint32_t>(pixel[2] << 16 | pixel[1] << 8 | pixel[0]));
      }
    cairo_surface_destroy(surface);
  }
  [[nodiscard]] std::uint32_t at(int x, int y) const {
    return colors.at(static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                     static_cast<std::size_t>(x));
  }
  [[nodiscard]] bool holds(std::uint32_t color) const {
    return std::find(colors.begin(), colors.end(), color) != colors.end();
  }
  /// Whether the blocks of color `expected`, each `zoom` wide and high, stand at (x, y) in
  /// row-major order.
  [[nodiscard]] bool shows(int x0,
                           int y0,
                           int zoom,
                           const std::vector<std::vector<std::uint32_t>>& expected) const {
    for (int y = 0; y < static_cast<int>(expected.size()) * zoom; ++y)
      for (int x = 0; x < static_cast<int>(expected[0].size()) * zoom; ++x)
        if (at(x0 + x, y0 + y) !=
            expected[static_cast<std::size_t>(y / zoom)][static_cast<std::size_t>(x / zoom)])
          return false;
    return true;
  }
  /// Whether shows() holds anywhere.
  [[nodiscard]] bool shows_somewhere(
      int zoom, const std::vector<std::vector<std::uint32_t>>& expected) const {
    for (int y = 0; y + static_cast<int>(expected.size()) * zoom <= height; ++y)
      for (int x = 0; x + static_cast<int>(expected[0].size()) * zoom <= width; ++x)
        if (shows(x, y, zoom, expected)) return true;
    return false;
  }
};

class Picture : public testing::Test {
 protected:
  Pixels drawn(const std::vector<PicturePanel>& panels, int columns = 1, int zoom = 1) {
    write_picture(panels, columns, "Heading", path(), zoom);
    return Pixels(path());
  }
  [[nodiscard]] std::filesystem::path path() const { return folder_ / "p.png"; }

 private:
  test::ScratchFolder folder_;
};

TEST_F(Picture, ShowsRowZeroOnTopFromBlackToWhiteAndClamps) {
  PicturePanel panel;
  panel.image = ramp(2, 3);  // 0 1 / 2 3 / 4 5
  panel.low = 1.0;
  panel.high = 4.0;
  for (const int zoom : {1, 7}) {
    const Pixels pixels = drawn({panel}, 1, zoom);
    EXPECT_TRUE(pixels.shows_somewhere(
        zoom, {{0x000000, 0x000000}, {0x555555, 0xAAAAAA}, {0xFFFFFF, 0xFFFFFF}}));
  }
}

TEST_F(Picture, DivergingColorsAreBlueWhiteRed) {
  PicturePanel panel;
  panel.image = Image2d(3, 1);
  panel.image.pixels = {-1.0F, 0.0F, 1.0F};
  panel.low = -1.0;
  panel.high = 1.0;
  panel.colors = PicturePanel::Colors::Diverging;
  EXPECT_TRUE(drawn({panel}, 1, 4).shows_somewhere(4, {{0x2166AB, 0xFFFFFF, 0xB3172B}}));
}

TEST_F(Picture, ValuesThatAreNotFiniteAreOrange) {
  PicturePanel panel;
  panel.image = ramp(8, 8);
  EXPECT_FALSE(drawn({panel}, 1, 4).holds(kOrange));
  panel.image.at(3, 3) = kNan;
  EXPECT_TRUE(drawn({panel}, 1, 4).holds(kOrange));
}

TEST_F(Picture, BoxesAreOutlinedAroundTheirPixels) {
  PicturePanel panel;
  panel.image = Image2d(40, 40);
  const Pixels without = drawn({panel}, 1, 4);
  panel.boxes = {{10, 20, 5, 5}};
  const Pixels with = drawn({panel}, 1, 4);
  ASSERT_EQ(with.width, without.width);
  int left = with.width, right = 0, top = with.height, bottom = 0;
  for (int y = 0; y < with.height; ++y)
    for (int x = 0; x < with.width; ++x)
      if (with.at(x, y) != without.at(x, y)) {
        left = std::min(left, x), right = std::max(right, x);
        top = std::min(top, y), bottom = std::max(bottom, y);
      }
  // Five pixels of 4 x 4 and half a line on either side.
  EXPECT_NEAR(right - left + 1, 20, 4);
  EXPECT_NEAR(bottom - top + 1, 20, 4);
}

TEST_F(Picture, GridIsRowMajor) {
  std::vector<PicturePanel> panels(3);
  const std::vector<float> greys{0.2F, 0.4F, 0.6F};
  for (std::size_t i = 0; i < 3; ++i) {
    panels[i].image = Image2d(200, 50);
    panels[i].image.pixels.assign(panels[i].image.pixels.size(), greys[i]);
  }
  const Pixels pixels = drawn(panels, 2);
  const auto center_of = [&](std::uint32_t color) {
    double x = 0.0, y = 0.0, count = 0.0;
    for (int row = 0; row < pixels.height; ++row)
      for (int column = 0; column < pixels.width; ++column)
        if (pixels.at(column, row) == color) x += column, y += row, count += 1.0;
    EXPECT_GE(count, 200 * 50);
    return std::pair(x / count, y / count);
  };
  const auto first = center_of(0x333333);
  const auto second = center_of(0x666666);
  const auto third = center_of(0x999999);
  EXPECT_GT(second.first, first.first + 200.0);
  EXPECT_NEAR(second.second, first.second, 3.0);  // the scale bars hold some pixels of each grey
  EXPECT_GT(third.second, first.second + 50.0);
  EXPECT_NEAR(third.first, first.first, 3.0);
}

TEST_F(Picture, LongTextsMakeThePictureHigherButNotWider) {
  PicturePanel panel;
  panel.image = ramp(200, 40);
  panel.title = "short";
  panel.caption = "short";
  const Pixels small = drawn({panel});
  panel.title = "a title of many words that cannot stand on a single line of this panel";
  panel.caption = std::string(300, 'w') + " and more\nlines";
  const Pixels high = drawn({panel});
  EXPECT_EQ(high.width, small.width);
  EXPECT_GT(high.height, small.height + 100);
}

TEST_F(Picture, TextsThatAreNotUtf8AreDrawnAllTheSame) {
  PicturePanel panel;
  panel.image = ramp(20, 20);
  const Pixels plain = drawn({panel});
  for (const char* text : {"\xFF\xFE",
                           "\xC3",
                           "\xE2\x82",
                           "\xED\xA0\x80",
                           "\xF4\x90\x80\x80",
                           "tab\there",
                           "µ ± 45°"}) {
    panel.title = text;
    EXPECT_GT(drawn({panel}).height, plain.height);
  }
}

TEST_F(Picture, SameInputGivesTheSameBytes) {
  PicturePanel panel;
  panel.image = ramp(20, 20);
  panel.title = "title";
  const std::filesystem::path other = path().parent_path() / "q.png";
  write_picture({panel}, 1, "Heading", path());
  write_picture({panel}, 1, "Heading", other);
  EXPECT_EQ(Pixels(path()).colors, Pixels(other).colors);
}

TEST_F(Picture, RefusesWhatWouldNotFitAndLeavesNothing) {
  PicturePanel panel;
  panel.image = ramp(20, 20);
  EXPECT_THROW(write_picture({panel}, 1, "", path(), 1'000'000'000), InputError);
  EXPECT_THROW(write_picture({panel}, 1, "", path(), 0), std::logic_error);
  EXPECT_THROW(write_picture({}, 1, "", path()), std::logic_error);
  EXPECT_THROW(write_picture({PicturePanel{}}, 1, "", path()), std::logic_error);
  EXPECT_THROW(write_picture({panel}, 1, "", path().parent_path() / "missing/p.png"), FileError);
  EXPECT_FALSE(std::filesystem::exists(path()));
}

TEST(Checkerboard, AlternatesFieldsStartingWithTheFirstImage) {
  Image2d a(6, 6);
  Image2d b(6, 6);
  for (int row = 0; row < 6; ++row)
    for (int column = 0; column < 6; ++column) {
      a.at(column, row) = static_cast<float>(column);         // 0 ... 5
      b.at(column, row) = static_cast<float>(100 * row + 7);  // 7 ... 507
    }
  const Image2d board = checkerboard(a, b, 2);
  EXPECT_EQ(board.at(0, 0), 0.0F);
  EXPECT_EQ(board.at(5, 4), 1.0F);
  EXPECT_EQ(board.at(2, 0), 0.0F);  // b's top row
  EXPECT_EQ(board.at(0, 2), board.at(1, 2));
  EXPECT_NEAR(static_cast<double>(board.at(0, 2)), 0.4, 1e-6);  // b's third of six rows
  EXPECT_NEAR(static_cast<double>(board.at(3, 3)), 0.6, 1e-6);  // a's fourth of six columns
}

TEST(Checkerboard, ScalesConstantAndPartlyInvalidImages) {
  Image2d a(4, 4);
  Image2d b = ramp(4, 4);
  b.at(3, 0) = kNan;
  const Image2d board = checkerboard(a, b, 2);
  EXPECT_EQ(board.at(0, 0), 0.0F);
  EXPECT_TRUE(std::isnan(board.at(3, 0)));
  EXPECT_THROW(checkerboard(a, ramp(3, 4), 2), std::logic_error);
  EXPECT_THROW(checkerboard(a, b, 0), std::logic_error);
}

TEST(PercentileWindow, InterpolatesBetweenSortedValues) {
  Image2d image(101, 1);
  for (int i = 0; i < 101; ++i) image.at(i, 0) = static_cast<float>((i * 37) % 101);
  const auto window = percentile_window(image, 1.0, 98.5);
  EXPECT_NEAR(window[0], 1.0, 1e-9);
  EXPECT_NEAR(window[1], 98.5, 1e-9);
  EXPECT_EQ(percentile_window(image, 0.0, 100.0), (std::array{0.0, 100.0}));
}

TEST(PercentileWindow, LeavesOutValuesThatAreNotFinite) {
  Image2d image(4, 1);
  image.pixels = {kNan, 3.0F, std::numeric_limits<float>::infinity(), 5.0F};
  EXPECT_EQ(percentile_window(image, 0.0, 100.0), (std::array{3.0, 5.0}));
  image.pixels = {kNan, kNan, kNan, kNan};
  EXPECT_EQ(percentile_window(image), (std::array{0.0, 0.0}));
  EXPECT_THROW(percentile_window(image, 90.0, 10.0), std::logic_error);
}

TEST(WritePicture, WritesAWholePictureOrNone) {
  const test::ScratchFolder folder;
  const PicturePanel panel{ramp(64, 64), 0.0, 4095.0, "A", "", {}, {}};
  for (const rlim_t limit : {0u, 100u, 1000u, 2000u}) {
    const test::FileSizeLimit full_disk(limit);
    EXPECT_THROW(write_picture({panel}, 1, "", folder / "a.png", 2), FileError) << limit;
    EXPECT_TRUE(std::filesystem::is_empty(folder.path())) << limit;
  }
}

}  // namespace
}  // namespace af
