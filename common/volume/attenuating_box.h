// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "volume/attenuation_volume.h"

namespace af {

/// The voxels of a CT that attenuate lie within these indices, inclusive.
struct AttenuatingBox {
  std::array<int, 3> low;
  std::array<int, 3> high;
};

/// The smallest such box; one pass over the CT. InputError when no voxel attenuates.
AttenuatingBox attenuating_box(const CtVolume& ct, const AttenuationModel& model);

/// Grid with border of the AttenuationVolume of a CT with that box.
CtGrid bordered_grid(const CtGrid& ct_grid, const AttenuatingBox& box);

}  // namespace af
