// SPDX-License-Identifier: Apache-2.0
#include "drr/ray_cast_drr.h"

namespace af {

RayFan ray_fan(const RigidTransform& room_from_ct, const View& view) {
  const RigidTransform ct_from_room = room_from_ct.inverse();
  const CameraGeometry& camera = view.camera;
  return {ct_from_room * camera.source_point,
          ct_from_room * camera.detector_point(view.roi.column, view.roi.row),
          ct_from_room.linear() * (camera.pixel_spacing_mm.x() * camera.column_direction),
          ct_from_room.linear() * (camera.pixel_spacing_mm.y() * camera.row_direction),
          view.roi.width,
          view.roi.height};
}

RayCastDrr::RayCastDrr(std::shared_ptr<const AttenuationVolume> volume,
                       const RayCasterOptions& options,
                       std::shared_ptr<ThreadPool> pool)
    : volume_(std::move(volume)), caster_(*volume_, options), pool_(std::move(pool)) {}

RenderStatus RayCastDrr::render(const RigidTransform& room_from_ct,
                                const View& view,
                                RenderWorkspace& /*workspace*/,
                                std::span<float> total_attenuation,
                                const std::optional<PoseGradients>& gradients) const {
  const RayFan fan = ray_fan(room_from_ct, view);
  if (!gradients) {
    caster_.cast(fan, total_attenuation, pool_.get());
    return {};
  }
  const RigidTransform ct_from_room = room_from_ct.inverse();
  caster_.cast_with_slopes(
      fan,
      total_attenuation,
      {ct_from_room * gradients->pivot_room_point, ct_from_room.linear(), gradients->planes},
      pool_.get());
  return {};
}

std::unique_ptr<RenderWorkspace> RayCastDrr::make_workspace() const {
  return std::make_unique<RenderWorkspace>();
}

}  // namespace af
