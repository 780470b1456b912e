// SPDX-License-Identifier: Apache-2.0
#include "precompute/design/probe_scene.h"

#include <algorithm>

namespace af {

LightSlab ProbeScene::planes(const FieldDesign& design) const {
  const StPlane rule = st_plane.value_or(design.slabs == 1 ? StPlane::Centre : StPlane::Centroid);
  const DepthSlabs slabs =
      design.slabs == 1 && rule == StPlane::Centre
          ? DepthSlabs{{}, {0.0}}
          : choose_depth_slabs(resampled.grid(), slice_sums, design.slabs, rule);
  return make_light_slab(
      camera,
      frame,
      range,
      volume.corner_points(),
      {design.uv_nodes, design.st_nodes, slabs.boundaries_y_mm, slabs.st_plane_y_mm, sources});
}

std::unique_ptr<const FieldCaster> ProbeScene::make_caster(const LightSlab& planes) const {
  return caster_named(caster).make({volume, &resampled, planes, quantizer, ray_caster});
}

int ProbeScene::most_slabs() const {
  return static_cast<int>(
      std::ranges::count_if(slice_sums, [](std::int64_t sum) { return sum > 0; }));
}

}  // namespace af
