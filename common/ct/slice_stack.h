// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "ct/ct_volume.h"

namespace af {

/// Parallel slices of one size. They need neither stand straight above each other (a tilted gantry)
/// nor be evenly spaced.
struct SliceStack {
  Eigen::Matrix3d axes =
      Eigen::Matrix3d::Identity();  ///< directions of columns, rows, slice normal
  Eigen::Vector2d spacing_mm = Eigen::Vector2d::Ones();
  int columns = 0;
  int rows = 0;
  std::vector<Eigen::Vector3d> origins_mm;  ///< centre of pixel (0, 0); ascending along the normal
};

/// The upright grid of a stack. It has the stack's axes and pixel spacing, as many slices as the
/// median distance asks for between the first and the last, and room for all slices' shifts.
CtGrid upright_grid(const SliceStack& stack);

/// A stack's HU (slice by slice) on its upright grid; -1000 HU beside the slices. Interpolation is
/// linear in the distance between two slices, along the line from pixel (0, 0) of one to that of
/// the other, and bilinear within a slice. This is trilinear interpolation in the stack's own
/// indices.
std::vector<std::int16_t> resampled(const SliceStack& stack,
                                    std::span<const std::int16_t> hu,
                                    const CtGrid& grid);

}  // namespace af
