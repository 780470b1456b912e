// SPDX-License-Identifier: Apache-2.0
// itk::ResampleImageFilter behind plain types: ITK brings an older Eigen, which must not meet ours.
#pragma once

#include <array>
#include <vector>

namespace af::test {

/// A grid whose axes need not be orthogonal: columns of `direction` are unit vectors.
struct ItkImageGrid {
  std::array<int, 3> size = {0, 0, 0};
  std::array<double, 3> origin_mm = {0, 0, 0};
  std::array<double, 3> spacing_mm = {1, 1, 1};
  std::array<std::array<double, 3>, 3> direction{};  ///< [row][column]
};

/// Values of an image at the points of another grid, by linear interpolation.
std::vector<double> itk_resampled(const ItkImageGrid& image_grid,
                                  const std::vector<double>& values,
                                  const ItkImageGrid& grid,
                                  double outside);

}  // namespace af::test
