// SPDX-License-Identifier: Apache-2.0
#include "precompute/field_caster.h"

#include <vector>

#include "base/error.h"

namespace af {

RayCastFieldCaster::RayCastFieldCaster(const AttenuationVolume& volume,
                                       const LightSlab& light_slab,
                                       const AttenuationQuantizer& quantizer,
                                       const RayCasterOptions& options)
    : light_slab_(light_slab),
      quantizer_(quantizer),
      caster_(volume, options),
      ct_from_slab_(light_slab.slab_from_ct.inverse()) {}

void RayCastFieldCaster::cast(const WorkUnit& unit, std::span<std::uint16_t> samples) const {
  check(samples.size() == unit.sample_count(), "one sample per node of the unit");
  const SlabGeometry& slab = light_slab_.slabs[unit.slab];
  // One fan per row of (s,t) nodes, placed by the lattice itself: a fan that began at the unit's
  // first row would round its points differently in every plan.
  RayFan row;
  row.columns = unit.t.count;
  row.rows = 1;
  row.column_step = ct_from_slab_.linear() * Eigen::Vector3d(0.0, 0.0, slab.t.spacing_mm());
  row.row_step = Eigen::Vector3d::Zero();
  const double plane_distance_mm = light_slab_.uv_plane_y_mm - slab.st_plane_y_mm;
  row.begin = (light_slab_.uv_plane_y_mm - slab.y_high_mm) / plane_distance_mm;
  row.end = (light_slab_.uv_plane_y_mm - slab.y_low_mm) / plane_distance_mm;
  std::vector<float> total_attenuation(static_cast<std::size_t>(unit.t.count));
  auto sample = samples.begin();
  for (int u = unit.u.begin; u < unit.u.end(); ++u)
    for (int v = unit.v.begin; v < unit.v.end(); ++v) {
      row.source_point = ct_from_slab_ * light_slab_.viewpoint(u, v);
      for (int s = unit.s.begin; s < unit.s.end(); ++s) {
        row.first_point = ct_from_slab_ * light_slab_.st_point(slab, s, unit.t.begin);
        caster_.cast(row, total_attenuation);
        for (const float value : total_attenuation) *sample++ = quantizer_.quantize(value);
      }
    }
}

}  // namespace af
