// SPDX-License-Identifier: Apache-2.0
#include "figures/picture_match.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.h"
#include "files/csv_table.h"
#include "xray/bilinear.h"

namespace af {
namespace {

constexpr std::array kLayings = {
    PictureLaying{"as it is", false, false, false},
    PictureLaying{"flipped left to right", false, true, false},
    PictureLaying{"flipped upside down", false, false, true},
    PictureLaying{"turned by 180 degrees", false, true, true},
    PictureLaying{"with columns and rows swapped", true, false, false},
    PictureLaying{"turned by 90 degrees clockwise", true, true, false},
    PictureLaying{"turned by 90 degrees anticlockwise", true, false, true},
    PictureLaying{"with columns and rows swapped and turned by 180 degrees", true, true, true},
};

/// Shrinks an image until no side is longer than `most`.
Image2d shrunk(const Image2d& image, int most) {
  return block_means(image, std::max(1, (std::max(image.width, image.height) + most - 1) / most));
}

Image2d laid(const Image2d& image, const PictureLaying& laying) {
  Image2d result(laying.swaps_axes ? image.height : image.width,
                 laying.swaps_axes ? image.width : image.height);
  for (int row = 0; row < result.height; ++row)
    for (int column = 0; column < result.width; ++column) {
      const int x = laying.flips_columns ? result.width - 1 - column : column;
      const int y = laying.flips_rows ? result.height - 1 - row : row;
      result.at(column, row) = laying.swaps_axes ? image.at(y, x) : image.at(x, y);
    }
  return result;
}

/// Normalised correlation of `a` at (column, row) with `b` at (column + dx, row + dy), over the
/// pixels that both have.
double correlation_at(const Image2d& a, const Image2d& b, int dx, int dy) {
  double n = 0.0;
  double sum_a = 0.0;
  double sum_b = 0.0;
  double sum_aa = 0.0;
  double sum_bb = 0.0;
  double sum_ab = 0.0;
  for (int row = std::max(0, -dy); row < std::min(a.height, b.height - dy); ++row)
    for (int column = std::max(0, -dx); column < std::min(a.width, b.width - dx); ++column) {
      const auto va = static_cast<double>(a.at(column, row));
      const auto vb = static_cast<double>(b.at(column + dx, row + dy));
      n += 1.0;
      sum_a += va;
      sum_b += vb;
      sum_aa += va * va;
      sum_bb += vb * vb;
      sum_ab += va * vb;
    }
  const double variance = (sum_aa - sum_a * sum_a / n) * (sum_bb - sum_b * sum_b / n);
  return n > 0.0 && variance > 0.0 ? (sum_ab - sum_a * sum_b / n) / std::sqrt(variance) : 0.0;
}

double best_correlation(const Image2d& a, const Image2d& b) {
  double best = -1.0;
  const int reach_x = b.width / 4;
  const int reach_y = b.height / 4;
  for (int dy = -reach_y; dy <= reach_y; dy += 2)
    for (int dx = -reach_x; dx <= reach_x; dx += 2)
      best = std::max(best, correlation_at(a, b, dx, dy));
  return best;
}

/// The middle of an image, enlarged to all of it.
Image2d enlarged(const Image2d& image, double factor) {
  const auto positions = [factor](int count) {
    const double middle = 0.5 * (count - 1);
    std::vector<double> places;
    places.reserve(static_cast<std::size_t>(count));
    for (int i = 0; i < count; ++i) places.push_back(middle + (i - middle) / factor);
    return places;
  };
  return resampled_bilinearly(image, positions(image.width), positions(image.height));
}

}  // namespace

Image2d block_means(const Image2d& image, int factor) {
  Image2d small(image.width / factor, image.height / factor);
  for (int row = 0; row < small.height; ++row)
    for (int column = 0; column < small.width; ++column) {
      double sum = 0.0;
      for (int y = 0; y < factor; ++y)
        for (int x = 0; x < factor; ++x)
          sum += static_cast<double>(image.at(column * factor + x, row * factor + y));
      small.at(column, row) = static_cast<float>(sum / (factor * factor));
    }
  return small;
}

std::vector<LayingMatch> laying_matches(const Image2d& xray, const Image2d& drr) {
  check(xray.width == drr.width && xray.height == drr.height, "pictures of one camera");
  constexpr int kMostPixels = 48;
  const Image2d small_xray = shrunk(xray, kMostPixels);
  const Image2d small_drr = shrunk(drr, kMostPixels);
  std::vector<LayingMatch> matches;
  for (const PictureLaying& laying : kLayings)
    if (!laying.swaps_axes || xray.width == xray.height)
      matches.push_back({laying, best_correlation(laid(small_xray, laying), small_drr)});
  return matches;
}

std::string laying_telltale(const std::vector<LayingMatch>& matches) {
  constexpr double kClearlyBetter = 0.1;
  constexpr double kWell = 0.6;
  const LayingMatch& best = *std::ranges::max_element(matches, {}, &LayingMatch::correlation);
  if (best.correlation < matches.front().correlation + kClearlyBetter || best.correlation < kWell)
    return {};
  return std::string("the X-ray looks more like the DRR when ") + best.laying.name +
         " (correlation " + fixed_text(best.correlation, 2) + ") than as it is (" +
         fixed_text(matches.front().correlation, 2) +
         "): check its orientation and the camera's directions; nothing is flipped here";
}

std::vector<ScaleMatch> scale_matches(const Image2d& xray, const Image2d& drr) {
  check(xray.width == drr.width && xray.height == drr.height, "pictures of one camera");
  constexpr int kMostPixels = 64;
  const Image2d small_xray = shrunk(xray, kMostPixels);
  const Image2d small_drr = shrunk(drr, kMostPixels);
  std::vector<ScaleMatch> matches = {{1.0, best_correlation(small_xray, small_drr)}};
  if (small_xray.width < 2 || small_xray.height < 2) return matches;
  constexpr double kStep = 1.1224620483;  // sixth root of 2
  constexpr int kStepsToTwice = 6;
  double factor = 1.0;
  for (int step = 1; step <= kStepsToTwice; ++step) {
    factor *= kStep;
    matches.push_back({factor, best_correlation(enlarged(small_xray, factor), small_drr)});
    matches.push_back({1.0 / factor, best_correlation(small_xray, enlarged(small_drr, factor))});
  }
  return matches;
}

std::string scale_telltale(const std::vector<ScaleMatch>& matches) {
  constexpr double kClearlyBetter = 0.1;
  constexpr double kWell = 0.6;
  constexpr double kExplainedByPoses = 1.25;
  const auto is_near = [&](const ScaleMatch& match) {
    return std::max(match.factor, 1.0 / match.factor) <= kExplainedByPoses;
  };
  const ScaleMatch& best = *std::ranges::max_element(matches, {}, &ScaleMatch::correlation);
  if (is_near(best) || best.correlation < kWell) return {};
  for (const ScaleMatch& match : matches)
    if (is_near(match) && best.correlation < match.correlation + kClearlyBetter) return {};
  return "the X-ray looks more like the DRR when scaled by " + fixed_text(best.factor, 2) +
         " (correlation " + fixed_text(best.correlation, 2) + ") than as it is (" +
         fixed_text(matches.front().correlation, 2) +
         "): check the pixel spacing, the distances of source and detector, and the CT's spacing; "
         "nothing is scaled here";
}

}  // namespace af
