// SPDX-License-Identifier: Apache-2.0
#include "xray/bilinear.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/error.h"

namespace af {

namespace {

/// A place along an axis: between which pixels, and how far towards the second.
struct AxisPlace {
  int lower = 0;
  int upper = 0;
  double share = 0.0;
};

std::vector<AxisPlace> places_on_axis(std::span<const double> positions, int count) {
  std::vector<AxisPlace> places;
  places.reserve(positions.size());
  for (const double position : positions) {
    const double inside = std::clamp(position, 0.0, static_cast<double>(count - 1));
    const int lower = static_cast<int>(inside);
    places.push_back({lower, std::min(lower + 1, count - 1), inside - lower});
  }
  return places;
}

}  // namespace

Image2d resampled_bilinearly(const Image2d& image,
                             std::span<const double> columns,
                             std::span<const double> rows) {
  check(image.width > 0 && image.height > 0, "an image without pixels has no values");
  const std::vector<AxisPlace> across = places_on_axis(columns, image.width);
  Image2d result(static_cast<int>(columns.size()), static_cast<int>(rows.size()));
  auto pixel = result.pixels.begin();
  for (const AxisPlace& y : places_on_axis(rows, image.height))
    for (const AxisPlace& x : across) {
      const auto along_row = [&](int row) {
        return std::lerp(static_cast<double>(image.at(x.lower, row)),
                         static_cast<double>(image.at(x.upper, row)),
                         x.share);
      };
      *pixel++ = static_cast<float>(std::lerp(along_row(y.lower), along_row(y.upper), y.share));
    }
  return result;
}

}  // namespace af
