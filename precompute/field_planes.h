// SPDX-License-Identifier: Apache-2.0
// All that af-precompute itself knows of where a field's nodes lie: it sizes the planes and says
// what they are. Everything else of it counts nodes (FieldLattice) or asks the caster.
#pragma once

#include <string>

#include "geometry/light_slab.h"
#include "precompute/field_source.h"

namespace af {

/// The planes of the options' field, for a motion range of `range`. Errors of make_light_slab().
LightSlab sized_planes(const FieldSource& source,
                       const PrecomputeOptions& options,
                       const MotionRange& range,
                       const DepthSlabs& depth_slabs);

/// What a dry run says of the planes.
std::string planes_text(const LightSlab& planes);

/// What other options would give.
std::string advice_text(const FieldSource& source,
                        const LightSlab& planes,
                        const PrecomputeOptions& options);

}  // namespace af
