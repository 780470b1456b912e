// SPDX-License-Identifier: Apache-2.0
#include "drr/ray_cast_drr.h"

#include <gtest/gtest.h>

#include "support/central_differences.h"
#include "support/ct_phantoms.h"
#include "support/cube_grid.h"
#include "support/plane_products.h"
#include "unit/drr/small_fields.h"
#include "volume/blurred_volume.h"

namespace af {
namespace {

TEST(RayCastDrr, GradientsAgreeWithCentralDifferences) {
  const AttenuationVolume sharp(
      ellipsoid_phantom(test::cube_grid(72, 1.25),
                        {{{0, 0, 0}, {38, 30, 34}, Eigen::Matrix3d::Identity(), 0},
                         {{12, -8, 10}, {9, 6, 14}, Eigen::Matrix3d::Identity(), 900}}),
      {});
  const RayCastDrr renderer(blurred_volume(sharp, 4.0));
  const View view{small_camera(), {3, 2, 20, 15}};
  const RigidTransform pose = pose_from_parameters({}, small_pose(6));
  const Eigen::Vector3d pivot(10.0, -20.0, 30.0);
  const std::size_t pixels = view.pixel_count();
  std::vector<float> values(pixels);
  std::vector<float> found(6 * pixels);
  std::vector<float> expected(6 * pixels);
  const auto workspace = renderer.make_workspace();
  renderer.render(pose, view, *workspace, values, PoseGradients{pivot, found});
  EXPECT_EQ(values, render_image(renderer, pose, view).pixels);
  test::central_difference_gradients(renderer, pose, view, *workspace, {pivot, expected});
  for (std::size_t k = 0; k < 6; ++k) {
    const auto plane = [&](const std::vector<float>& planes) {
      return std::span(planes).subspan(k * pixels, pixels);
    };
    test::PlaneProducts products;
    products.add(plane(found), plane(expected));
    // Differences cross kinks of the interpolant, and jumps of the number of samples.
    EXPECT_LT(products.relative_distance(), 0.01) << "parameter " << k;
  }
}

}  // namespace
}  // namespace af
