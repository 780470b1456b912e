// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "xray/image2d.h"

namespace af {

/// The image between pixel centres by cubic convolution (Keys, IEEE TASSP 29:1153, 1981). Beyond
/// its edges the outermost pixels continue.
double sampled_cubic(const Image2d& image, double column, double row);

/// Means of factor x factor pixels. Columns and rows that fill none are left out.
Image2d binned_image(const Image2d& image, int factor);

/// Gaussian of `fine_px` minus Gaussian of `coarse_px` (standard deviations). It keeps edges and
/// structures, without what varies slowly, such as scatter. Invalid pixels contribute nothing, and
/// are 0 in the result. \test BandPass.LeavesOutInvalidPixels
class BandPass {
 public:
  /// `is_valid`: one entry per pixel of images of width x height.
  BandPass(
      int width, int height, std::vector<unsigned char> is_valid, double fine_px, double coarse_px);
  [[nodiscard]] Image2d operator()(const Image2d& image) const;

 private:
  std::vector<unsigned char> is_valid_;
  double fine_px_;
  double coarse_px_;
  Image2d fine_weight_;  ///< share of valid pixels within the Gaussian
  Image2d coarse_weight_;
};

}  // namespace af
