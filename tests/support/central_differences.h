// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include <gtest/gtest.h>

#include "base/error.h"
#include "drr/drr_renderer.h"
#include "support/plane_products.h"

namespace af::test {

/// Steps of central_difference_gradients(). The defaults are large compared with the
/// single-precision noise of a DRR, and small compared with its structures.
struct DifferenceSteps {
  double rotation_rad = 1e-3;
  double translation_mm = 0.1;
};

inline RigidTransform perturbed(const RigidTransform& room_from_ct,
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

/// Derivatives by central differences of render(), the oracle for the renderers' own.
inline void central_difference_gradients(const DrrRenderer& renderer,
                                         const RigidTransform& room_from_ct,
                                         const View& view,
                                         RenderWorkspace& workspace,
                                         const PoseGradients& gradients,
                                         const DifferenceSteps& steps = {}) {
  check(gradients.planes.size() == 6 * view.pixel_count(),
        "six gradient planes of the view's size");
  std::vector<float> plus(view.pixel_count());
  std::vector<float> minus(view.pixel_count());
  for (int parameter = 0; parameter < 6; ++parameter) {
    const double step = parameter < 3 ? steps.rotation_rad : steps.translation_mm;
    for (const double sign : {1.0, -1.0}) {
      const RigidTransform pose =
          perturbed(room_from_ct, gradients.pivot_room_point, parameter, sign * step);
      renderer.render(pose, view, workspace, sign > 0.0 ? plus : minus);
    }
    float* plane =
        gradients.planes.data() + static_cast<std::size_t>(parameter) * view.pixel_count();
    for (std::size_t i = 0; i < plus.size(); ++i)
      plane[i] = (plus[i] - minus[i]) / static_cast<float>(2.0 * step);
  }
}

/// The relative distance of a renderer's own derivatives from central differences, per parameter.
/// Also expects that the image with derivatives is that of render() alone.
inline std::vector<double> gradient_distances(const DrrRenderer& renderer,
                                              const RigidTransform& room_from_ct,
                                              const View& view,
                                              const Eigen::Vector3d& pivot_room_point) {
  const std::size_t pixels = view.pixel_count();
  std::vector<float> values(pixels);
  std::vector<float> found(6 * pixels);
  std::vector<float> expected(6 * pixels);
  const auto workspace = renderer.make_workspace();
  renderer.render(room_from_ct, view, *workspace, values, PoseGradients{pivot_room_point, found});
  EXPECT_EQ(values, render_image(renderer, room_from_ct, view).pixels);
  central_difference_gradients(
      renderer, room_from_ct, view, *workspace, {pivot_room_point, expected});
  std::vector<double> distances;
  for (std::size_t k = 0; k < 6; ++k) {
    PlaneProducts products;
    products.add(std::span(found).subspan(k * pixels, pixels),
                 std::span(expected).subspan(k * pixels, pixels));
    distances.push_back(products.relative_distance());
  }
  return distances;
}

}  // namespace af::test
