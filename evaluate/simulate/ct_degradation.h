// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "ct/ct_volume.h"

namespace af {

/// A poorer CT of the same patient, such as a planning CT with thick slices and a low dose.
struct CtDegradationOptions {
  double slice_mm = 3.0;   ///< slices are averaged in groups of about this thickness
  double noise_hu = 30.0;  ///< standard deviation, independent from voxel to voxel
  int step_hu = 20;        ///< values are rounded to multiples of this
  int threads = 0;         ///< 0: as many as the hardware has; voxels do not depend on it
};

/// Slices (k) per averaged group: slice_mm over the slice spacing, rounded, at least 1.
int slices_per_group(const CtGrid& grid, double slice_mm);

/// Averages groups of slices (those left over at the end are dropped), adds noise to voxels of at
/// least `air_below_hu` (lower ones attenuate nothing), and rounds. A voxel lies at the middle of
/// the voxels that it averages. Noise is keyed by (seed, key, voxel). Throws InputError when fewer
/// than two groups remain.
/// \test DegradedCt.KeepsEveryVoxelWhereItsMeanIs
CtVolume degraded_ct(const CtVolume& ct,
                     const CtDegradationOptions& options,
                     int air_below_hu,
                     std::uint64_t seed,
                     std::uint64_t key);

}  // namespace af
