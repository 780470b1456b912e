// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "xray/image2d.h"

namespace af::registration {

/// Where an image changes, and which way: its gradient g as g / sqrt|g|, so that a few strong edges
/// do not outweigh all others, rounded to kLargestEdge steps. Correlations of such images are
/// sums of integers: exact, and the same in any order.
class EdgeImage {
 public:
  /// Kept so small that sums over 8000 pixels fit into 32 bits.
  static constexpr int kLargestEdge = 255;
  static constexpr int kMostPixels = 8000;

  EdgeImage() = default;
  /// Edges are 0 where the gradient would look at a pixel that is not used (`used`: one per pixel,
  /// 0: not used; empty: all are), and outside. `border`: pixels of zeros to add on every side.
  EdgeImage(const Image2d& image, std::span<const std::uint8_t> used, int border);

  [[nodiscard]] int width() const { return width_; }    ///< the border included
  [[nodiscard]] int height() const { return height_; }  ///< likewise
  /// Along columns and rows, pixel by pixel.
  [[nodiscard]] const std::int16_t* edges() const { return edges_.data(); }
  /// How many numbers edges() has.
  [[nodiscard]] std::size_t edge_count() const {
    return 2 * static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_);
  }
  /// Mean of squares over the pixels within the border.
  [[nodiscard]] double mean_energy() const;
  /// Sum of squares over the rectangle whose first pixel is (column, row).
  [[nodiscard]] std::int64_t energy(int column, int row, int width, int height) const;

 private:
  int width_ = 0;
  int height_ = 0;
  int border_ = 0;
  std::vector<std::int16_t> edges_;
  std::vector<std::int64_t> energy_sums_;  ///< over all pixels above and to the left
};

/// The shifts at which a pattern is compared: where its first pixel lies in the image.
struct ShiftWindow {
  int first_column = 0;
  int first_row = 0;
  int columns = 0;
  int rows = 0;

  [[nodiscard]] std::size_t size() const {
    return static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows);
  }
};

/// How alike a pattern is to an image at every shift of a window: scalar products over the roots of
/// both energies, from -1 to 1, row by row. Where the image shows less than a quarter of its mean
/// energy, that quarter counts instead, so that the chance likeness of a few edges does not win.
/// The pattern stays within the image, and `likeness` has as many values as there are shifts.
/// \test EdgeCorrelation.FindsAPatternWhereItWasCutOut
void correlate(const EdgeImage& pattern,
               const EdgeImage& image,
               const ShiftWindow& window,
               std::span<float> likeness);

/// A quarter of the squares of an image's edges, in the order of EdgeImage::edges(), and some zeros
/// that kernels may read.
std::vector<std::int16_t> quarter_squares(const EdgeImage& image);

/// The same where only a part of the pattern counts (`used`: one per pixel, 0: not used), as of a
/// CT of one bone, which shows nothing of what is around it. Both energies are those within that
/// part. `image_squares`: quarter_squares() of the image.
/// \test EdgeCorrelation.WithinAPartIgnoresWhatIsAroundIt
void correlate_within(std::span<const std::uint8_t> used,
                      const EdgeImage& pattern,
                      const EdgeImage& image,
                      std::span<const std::int16_t> image_squares,
                      const ShiftWindow& window,
                      std::span<float> likeness);

}  // namespace af::registration
