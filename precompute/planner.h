// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "precompute/work_unit.h"

namespace af {

/// How a field is cut into units. The payload does not depend on it.
struct PlanOptions {
  std::int64_t rays_per_unit = 262144;  ///< about 0.2 to 0.5 s of the reference caster
};

std::vector<std::string> problems(const PlanOptions& options);

/// Units that cover every stored node of every slab exactly once, in the order slab, u, v, s. A
/// unit grows from 2 x 2 viewpoints by further viewpoints when these have too few rays, first along
/// u (viewpoints of equal v share the shear-warp caster's first pass), and is cut into bands of s
/// rows when they have too many.
std::vector<WorkUnit> plan_units(const LightSlab& light_slab, const PlanOptions& options);

/// Unit size that leaves every rank enough units to end together: not more than `largest`, at least
/// 16 units a rank.
PlanOptions plan_options_for_ranks(const LightSlab& light_slab,
                                   int ranks,
                                   const PlanOptions& largest = {});

/// Rays of all slabs' stored nodes.
std::int64_t stored_ray_count(const LightSlab& light_slab);

/// Tiles of all slabs.
std::int64_t stored_tile_count(const LightSlab& light_slab);

}  // namespace af
