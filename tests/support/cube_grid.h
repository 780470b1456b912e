// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "ct/ct_volume.h"

namespace af::test {

/// side^3 voxels about the origin.
inline CtGrid cube_grid(int side, double spacing_mm) {
  CtGrid grid;
  grid.size = {side, side, side};
  grid.spacing_mm = Eigen::Vector3d::Constant(spacing_mm);
  grid.origin_mm = Eigen::Vector3d::Constant(-0.5 * (side - 1) * spacing_mm);
  return grid;
}

}  // namespace af::test
