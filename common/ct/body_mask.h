// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "ct/ct_volume.h"

namespace af {

/// What remove_all_but_body() did.
struct BodyRemoval {
  std::size_t parts_kept = 0;      ///< bodies: the largest, and others at least a tenth of its size
  std::size_t voxels_removed = 0;  ///< voxels of at least -900 HU outside the body
  double removed_ml = 0.0;
  /// Share of the voxels of 300 HU or more that were removed. It is large where the body is hollow,
  /// such as a dry skull, whose walls are too thin to be kept.
  double dense_share_removed = 0.0;
};

/// Turns everything but the body into air (-1000 HU). The body is tissue (above -300 HU) that is
/// still connected in 3D after every axial slice has lost 3.5 mm along its edges. That cuts what
/// merely touches it (table, head holder, cables). The 3.5 mm are then given back, and the body
/// includes everything that it encloses in its axial slice (lungs, airways). What is thicker than 7
/// mm and holds a tenth of the body's volume stays. Throws InputError when nothing is tissue.
BodyRemoval remove_all_but_body(const CtGrid& grid, std::span<std::int16_t> hu);

}  // namespace af
