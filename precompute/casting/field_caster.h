// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "precompute/casting/work_unit.h"

namespace af {

/// The one interface of all casters of fields. Gives the quantised line integrals of one unit.
class FieldCaster {
 public:
  virtual ~FieldCaster() = default;

  /// Quantised total attenuation of the unit's slab along the ray through each viewpoint and (s,t)
  /// node. The ray does not stop at the (s,t) plane: all of the slab counts. `samples` is
  /// [u][v][s][t], t fastest, unit.sample_count() values. A sample depends on its node alone, never
  /// on the unit in which it is cast. Re-entrant.
  virtual void cast(const WorkUnit& unit, std::span<std::uint16_t> samples) const = 0;
};

}  // namespace af
