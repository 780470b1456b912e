// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <vector>

#include "geometry/light_slab.h"
#include "precompute/casting/field_caster.h"
#include "precompute/casting/shear_warp_caster.h"
#include "precompute/casting/unit_planner.h"

namespace af {

/// u, v, s, t.
using Node = std::array<int, 4>;
using NodeSamples = std::map<Node, std::uint16_t>;

/// Samples of one slab, cast in the units of a plan.
inline NodeSamples cast_plan(const FieldCaster& caster,
                             const LightSlab& light_slab,
                             const PlanOptions& plan = kShearWarpPlan,
                             std::size_t slab = 0) {
  NodeSamples by_node;
  for (const WorkUnit& unit : plan_units(light_slab.lattice(), plan)) {
    if (unit.slab != slab) continue;
    std::vector<std::uint16_t> samples(unit.sample_count());
    caster.cast(unit, samples);
    auto sample = samples.begin();
    for (int u = unit.u.begin; u < unit.u.end(); ++u)
      for (int v = unit.v.begin; v < unit.v.end(); ++v)
        for (int s = unit.s.begin; s < unit.s.end(); ++s)
          for (int t = unit.t.begin; t < unit.t.end(); ++t) by_node[{u, v, s, t}] = *sample++;
  }
  return by_node;
}

}  // namespace af
