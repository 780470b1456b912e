// SPDX-License-Identifier: Apache-2.0
#include "precompute/casting/corrected_caster.h"

#include <algorithm>
#include <utility>

namespace af {

CorrectedFieldCaster::CorrectedFieldCaster(std::unique_ptr<const FieldCaster> of_ct,
                                           MeasuredResidual residual,
                                           const LightSlab& light_slab,
                                           const AttenuationQuantizer& quantizer)
    : of_ct_(std::move(of_ct)),
      residual_(std::move(residual)),
      light_slab_(light_slab),
      quantizer_(quantizer),
      ct_from_slab_(light_slab.slab_from_ct.inverse()) {}

void CorrectedFieldCaster::cast(const WorkUnit& unit, std::span<std::uint16_t> samples) const {
  of_ct_->cast(unit, samples);
  const SlabGeometry& slab = light_slab_.slabs[unit.slab];
  const double plane_distance_mm = light_slab_.uv_plane_y_mm - slab.st_plane_y_mm;
  const double begin = (light_slab_.uv_plane_y_mm - slab.y_high_mm) / plane_distance_mm;
  const double end = (light_slab_.uv_plane_y_mm - slab.y_low_mm) / plane_distance_mm;
  auto sample = samples.begin();
  for (int u = unit.u.begin; u < unit.u.end(); ++u)
    for (int v = unit.v.begin; v < unit.v.end(); ++v) {
      const Eigen::Vector3d viewpoint = ct_from_slab_ * light_slab_.viewpoint(u, v);
      for (int s = unit.s.begin; s < unit.s.end(); ++s)
        for (int t = unit.t.begin; t < unit.t.end(); ++t, ++sample) {
          if (*sample == 0) continue;
          const Eigen::Vector3d through = ct_from_slab_ * light_slab_.st_point(slab, s, t);
          const double beyond = residual_.along(viewpoint, through, begin, end);
          if (beyond == 0.0) continue;
          const double sum = static_cast<double>(quantizer_.dequantize(*sample)) + beyond;
          *sample = quantizer_.quantize(static_cast<float>(std::max(0.0, sum)));
        }
    }
}

}  // namespace af
