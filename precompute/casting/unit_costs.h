// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

#include "geometry/light_slab.h"
#include "precompute/casting/work_unit.h"

namespace af {

/// The cost of casting each unit, relative to one ray through the whole CT, so that costly units
/// can be handed out first. Rays that miss the box of all attenuation (`attenuating_corners_ct`, ct
/// frame) cost little. A thin slab costs less, because fewer slices are summed.
std::vector<double> unit_costs(const std::vector<WorkUnit>& units,
                               const LightSlab& light_slab,
                               const std::array<Eigen::Vector3d, 8>& attenuating_corners_ct);

}  // namespace af
