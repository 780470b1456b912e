// SPDX-License-Identifier: Apache-2.0
#include "precompute/casting/trilinear_caster.h"

#include <algorithm>
#include <array>

#include "base/error.h"

namespace af {

TrilinearFieldCaster::TrilinearFieldCaster(const AttenuationVolume& volume,
                                           const LightSlab& light_slab,
                                           const AttenuationQuantizer& quantizer,
                                           const RayCasterOptions& options)
    : light_slab_(light_slab),
      quantizer_(quantizer),
      caster_(volume, options),
      ct_from_slab_(light_slab.slab_from_ct.inverse()) {}

void TrilinearFieldCaster::cast(const WorkUnit& unit, std::span<std::uint16_t> samples) const {
  check(samples.size() == unit.sample_count(), "one sample per node of the unit");
  const SlabGeometry& slab = light_slab_.slabs[unit.slab];
  const double plane_distance_mm = light_slab_.uv_plane_y_mm - slab.st_plane_y_mm;
  RayFan run;
  run.rows = 1;
  run.column_step = ct_from_slab_.linear() * Eigen::Vector3d(0.0, 0.0, slab.t.spacing_mm());
  run.row_step = Eigen::Vector3d::Zero();
  run.begin = (light_slab_.uv_plane_y_mm - slab.y_high_mm) / plane_distance_mm;
  run.end = (light_slab_.uv_plane_y_mm - slab.y_low_mm) / plane_distance_mm;
  std::array<float, kRunOfT> total_attenuation{};
  auto sample = samples.begin();
  for (int u = unit.u.begin; u < unit.u.end(); ++u)
    for (int v = unit.v.begin; v < unit.v.end(); ++v) {
      run.source_point = ct_from_slab_ * light_slab_.viewpoint(u, v);
      for (int s = unit.s.begin; s < unit.s.end(); ++s)
        // There is one fan per run of nodes, placed by the lattice itself. Fans that depended on
        // the plan would round their points differently.
        for (int t = unit.t.begin; t < unit.t.end(); t += kRunOfT) {
          run.columns = std::min(kRunOfT, unit.t.end() - t);
          run.first_point = ct_from_slab_ * light_slab_.st_point(slab, s, t);
          const auto values =
              std::span(total_attenuation).first(static_cast<std::size_t>(run.columns));
          caster_.cast(run, values);
          for (const float value : values) *sample++ = quantizer_.quantize(value);
        }
    }
}

}  // namespace af
