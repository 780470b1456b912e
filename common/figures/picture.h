// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "xray/image2d.h"

namespace af {

/// What is drawn over a panel's image. Places are in its pixels, where integers are pixel centres.
enum class PictureColor { Ink, Yellow, Cyan, Red, Green };

/// A line through points.
struct PictureLine {
  std::vector<std::array<double, 2>> points;
  PictureColor color = PictureColor::Yellow;
  double width_px = 1.5;  ///< in pixels of the picture
};

/// A small mark with a text beside it.
struct PictureMark {
  enum class Shape { None, Label, Cross, Circle, Dot };
  std::array<double, 2> place = {0.0, 0.0};
  Shape shape = Shape::None;
  std::string
      text;  ///< centred on the place where the mark is None or Label, in large and small letters
  PictureColor color = PictureColor::Yellow;
};

/// One panel of a picture: an image with its grey (or diverging blue-white-red) window and a
/// caption.
struct PicturePanel {
  enum class Colors { Grey, Diverging };
  Image2d image;
  double low = 0.0;
  double high = 1.0;
  std::string title;
  std::string caption;
  Colors colors = Colors::Grey;
  std::vector<RegionOfInterest> boxes;  ///< outlined on the panel
  std::vector<PictureLine> lines = {};
  std::vector<PictureMark> marks = {};
  bool has_scale = true;  ///< the bar of the window below it
};

/// Draws panels in a row-major grid of `columns` columns with titles, captions and the range of
/// their window, as PNG (cairo), row 0 on top. One image pixel becomes `zoom` x `zoom` picture
/// pixels. Values beyond the window take the color of its end; values that are not finite are
/// orange. Atomic. Throws InputError when the picture would be larger than 30000 pixels on a side
/// or 4e8 in all.
void write_picture(const std::vector<PicturePanel>& panels,
                   int columns,
                   const std::string& heading,
                   const std::filesystem::path& path,
                   int zoom = 1);

/// Checkerboard of two images of one size, with fields of `field_px` pixels. Both are scaled to [0,
/// 1] by their own 1st and 99th percentile. The field at pixel (0, 0) shows `a`.
Image2d checkerboard(const Image2d& a, const Image2d& b, int field_px);

/// Window (low, high) between percentiles of an image's finite values, in its own units; (0, 0)
/// when it has none. Percentiles are interpolated between values.
std::array<double, 2> percentile_window(const Image2d& image,
                                        double low_percent = 1.0,
                                        double high_percent = 99.0);

}  // namespace af
