// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "ct/ct_volume.h"

namespace af {

/// Parallel slices of one size that need not stand straight above each other (a tilted gantry) nor
/// at even distances.
struct SliceStack {
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();  ///< of columns, rows, slice normal
  Eigen::Vector2d spacing_mm = Eigen::Vector2d::Ones();
  int columns = 0;
  int rows = 0;
  std::vector<Eigen::Vector3d> origins_mm;  ///< centre of pixel (0, 0); ascending along the normal
};

/// The upright grid of a stack: its axes and pixel spacing, as many slices as the median distance
/// asks for between the first and the last, and room for all slices' shifts.
CtGrid upright_grid(const SliceStack& stack);

/// A stack's HU (slice by slice) on its upright grid: linear in the distance between two slices,
/// along the line that leads from the one's pixel (0, 0) to the other's, and bilinear within a
/// slice; -1000 HU beside the slices. This is trilinear interpolation in the stack's own indices.
std::vector<std::int16_t> resampled(const SliceStack& stack,
                                    std::span<const std::int16_t> hu,
                                    const CtGrid& grid);

}  // namespace af
