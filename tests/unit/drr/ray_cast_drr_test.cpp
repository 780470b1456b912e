// SPDX-License-Identifier: Apache-2.0
#include "drr/ray_cast_drr.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ct/blurred_volume.h"
#include "support/central_differences.h"
#include "support/ct_phantoms.h"
#include "support/cube_grid.h"
#include "unit/drr/small_fields.h"

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
  // Differences cross kinks of the interpolant, and jumps of the number of samples.
  EXPECT_THAT(test::gradient_distances(renderer, pose, view, {10.0, -20.0, 30.0}),
              testing::Each(testing::Lt(0.01)));
}

}  // namespace
}  // namespace af
