// SPDX-License-Identifier: Apache-2.0
#include "drr/drr_renderer.h"

#include <vector>

#include "base/error.h"

namespace af {

namespace {

RigidTransform perturbed(const RigidTransform& room_from_ct,
                         const Eigen::Vector3d& pivot_room_point,
                         int parameter,
                         double amount) {
  PoseParameters offset;
  if (parameter < 3)
    offset.rotation_rad[parameter] = amount;
  else
    offset.translation_mm[parameter - 3] = amount;
  const PoseFrame about_pivot{Eigen::Matrix3d::Identity(), pivot_room_point, pivot_room_point};
  return pose_from_parameters(about_pivot, offset) * room_from_ct;
}

}  // namespace

View View::whole_detector(const CameraGeometry& camera) {
  return {camera, {0, 0, camera.size_px.x(), camera.size_px.y()}};
}

View View::coarser(int factor) const {
  check(factor >= 1 && roi.width >= factor && roi.height >= factor,
        "a coarse pixel must fit into the region");
  const double center = 0.5 * (factor - 1);
  View coarse = *this;
  coarse.camera.detector_origin_point =
      camera.detector_point(roi.column + center, roi.row + center);
  coarse.camera.pixel_spacing_mm = factor * camera.pixel_spacing_mm;
  coarse.camera.size_px = {roi.width / factor, roi.height / factor};
  coarse.roi = {0, 0, roi.width / factor, roi.height / factor};
  return coarse;
}

Image2d render_image(const DrrRenderer& renderer,
                     const RigidTransform& room_from_ct,
                     const View& view,
                     std::int64_t* rays_outside) {
  Image2d image(view.roi.width, view.roi.height);
  const auto workspace = renderer.make_workspace();
  const RenderStatus status = renderer.render(room_from_ct, view, *workspace, image.pixels);
  if (rays_outside != nullptr) *rays_outside = status.rays_outside;
  return image;
}

RenderStatus central_difference_gradients(const DrrRenderer& renderer,
                                          const RigidTransform& room_from_ct,
                                          const View& view,
                                          RenderWorkspace& workspace,
                                          const PoseGradients& gradients,
                                          const DifferenceSteps& steps) {
  check(gradients.planes.size() == 6 * view.pixel_count(),
        "six gradient planes of the view's size");
  std::vector<float> plus(view.pixel_count());
  std::vector<float> minus(view.pixel_count());
  RenderStatus worst;
  for (int parameter = 0; parameter < 6; ++parameter) {
    const double step = parameter < 3 ? steps.rotation_rad : steps.translation_mm;
    for (const double sign : {1.0, -1.0}) {
      const RigidTransform pose =
          perturbed(room_from_ct, gradients.pivot_room_point, parameter, sign * step);
      const RenderStatus status = renderer.render(pose, view, workspace, sign > 0.0 ? plus : minus);
      worst.rays_outside = std::max(worst.rays_outside, status.rays_outside);
    }
    float* plane =
        gradients.planes.data() + static_cast<std::size_t>(parameter) * view.pixel_count();
    for (std::size_t i = 0; i < plus.size(); ++i)
      plane[i] = (plus[i] - minus[i]) / static_cast<float>(2.0 * step);
  }
  return worst;
}

}  // namespace af
