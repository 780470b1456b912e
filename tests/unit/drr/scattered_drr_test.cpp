// SPDX-License-Identifier: Apache-2.0
#include "drr/scattered_drr.h"

#include <cmath>
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "drr/field_renderer.h"
#include "drr/xray_beam.h"
#include "support/central_differences.h"
#include "unit/drr/small_fields.h"

namespace af {
namespace {

std::shared_ptr<const DrrRenderer> leaning_field() {
  return make_field_renderer(
      small_field([](const RayNodes& at) { return 2.0 + at.u + at.v + at.s + at.t; }, 1), "linear");
}

TEST(ScatteredDrr, AddsTheMeanPrimarySignalTimesTheRatio) {
  constexpr double kRatio = 0.7;
  const auto primary = leaning_field();
  const View view{small_camera(), {3, 2, 20, 15}};
  const Image2d without = render_image(*primary, RigidTransform::Identity(), view);
  const Image2d with =
      render_image(ScatteredDrr(primary, kRatio), RigidTransform::Identity(), view);
  double mean = 0.0;
  for (const float u : without.pixels)
    mean += std::exp(-static_cast<double>(u)) / static_cast<double>(without.pixels.size());
  for (std::size_t i = 0; i < with.pixels.size(); ++i)
    // Rounding of U to single precision.
    EXPECT_NEAR(std::exp(-static_cast<double>(with.pixels[i])),
                std::exp(-static_cast<double>(without.pixels[i])) + kRatio * mean,
                1e-6 * (1.0 + kRatio));
}

TEST(ScatteredDrr, OfNoScatterIsThePrimary) {
  const auto primary = leaning_field();
  const View view{small_camera(), {3, 2, 20, 15}};
  const Image2d without = render_image(*primary, RigidTransform::Identity(), view);
  const Image2d with = render_image(ScatteredDrr(primary, 0.0), RigidTransform::Identity(), view);
  for (std::size_t i = 0; i < with.pixels.size(); ++i)
    EXPECT_NEAR(with.pixels[i], without.pixels[i], 1e-6f * (1.0f + without.pixels[i]));
  // An ordinary beam leaves the renderer as it is.
  EXPECT_EQ(XrayBeam({}, {}).renderer(primary, nullptr), primary);
}

TEST(ScatteredDrr, GradientsAgreeWithCentralDifferences) {
  const ScatteredDrr renderer(leaning_field(), 0.7);
  const View view{small_camera(), {3, 2, 20, 15}};
  const RigidTransform pose = pose_from_parameters({}, small_pose(4));
  EXPECT_THAT(test::gradient_distances(renderer, pose, view, {5.0, 3.0, -8.0}),
              testing::Each(testing::Lt(0.01)));
}

}  // namespace
}  // namespace af
