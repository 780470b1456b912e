// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "precompute/casting/work_unit.h"

namespace af {

/// How a field is cut into units. The payload does not depend on it.
struct PlanOptions {
  std::int64_t rays_per_unit = 262144;  ///< about 0.2 to 0.5 s of the reference caster
};

/// Most nodes of a unit along s and t. They are those of the chunks of field files
/// (kIndexChunkTiles), so that a unit that is not cut is written as whole chunks.
inline constexpr int kLargestS = 256;
inline constexpr int kLargestT = 128;

/// Units that cover every stored node of every slab exactly once, in the order slab, u, v, s, t. A
/// unit begins as a row of viewpoints along u and two along v (viewpoints of equal v share the
/// shear-warp caster's first pass) over one chunk of the field file. With too few rays it grows
/// along v. With too many it is cut first along t and s to runs of kRunOfT nodes, which costs that
/// caster little, then along u. Along t it begins at a multiple of kRunOfT nodes of what is stored.
std::vector<WorkUnit> plan_units(const FieldLattice& lattice, const PlanOptions& options);

/// A unit size that leaves every rank enough units for all ranks to finish together: no more than
/// `largest`, and at least 16 units per rank.
PlanOptions plan_options_for_ranks(const FieldLattice& lattice,
                                   int ranks,
                                   const PlanOptions& largest = {});

}  // namespace af
