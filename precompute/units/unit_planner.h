// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>
#include <vector>

#include "precompute/units/work_unit.h"

namespace af {

/// How a field is cut into units. The payload does not depend on it.
struct PlanOptions {
  std::int64_t rays_per_unit = 262144;  ///< about 0.2 to 0.5 s of the reference caster
};

std::vector<std::string> problems(const PlanOptions& options);

/// Most nodes of a unit along s and t: the chunks of field files (kIndexChunkTiles), so that a unit
/// is written as whole chunks.
inline constexpr int kLargestS = 256;
inline constexpr int kLargestT = 128;

/// Units that cover every stored node of every slab exactly once, in the order slab, u, v, s, t. A
/// unit begins as a row of viewpoints along u and two along v (viewpoints of equal v share the
/// shear-warp caster's first pass) over one chunk of the field file. With too few rays it grows
/// along v; with too many it is cut first along t and s to runs of kRunOfT nodes, which costs that
/// caster little, then along u. Along t it begins at a multiple of kRunOfT nodes of what is stored.
std::vector<WorkUnit> plan_units(const LightSlab& light_slab, const PlanOptions& options);

/// A unit size that leaves every rank enough units for all ranks to end together: not more than
/// `largest`, at least 16 units a rank.
PlanOptions plan_options_for_ranks(const LightSlab& light_slab,
                                   int ranks,
                                   const PlanOptions& largest = {});

/// The cost of casting each unit, in units of one ray through the whole CT, for handing out the
/// costly units first. Rays that miss the box of all attenuation (`attenuating_corners_ct`, ct
/// frame) cost little, and a thin slab costs less, because fewer slices are summed.
std::vector<double> unit_costs(const std::vector<WorkUnit>& units,
                               const LightSlab& light_slab,
                               const std::array<Eigen::Vector3d, 8>& attenuating_corners_ct);

/// Rays of all slabs' stored nodes.
std::int64_t stored_ray_count(const LightSlab& light_slab);

/// Tiles of all slabs.
std::int64_t stored_tile_count(const LightSlab& light_slab);

}  // namespace af
