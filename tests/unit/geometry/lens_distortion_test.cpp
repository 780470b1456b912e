// SPDX-License-Identifier: Apache-2.0
#include "geometry/lens_distortion.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geometry/pinhole_camera.h"

namespace af {
namespace {

using Eigen::Vector2d;

constexpr LensDistortion kFive = {{-0.35, 0.12, 0.004, -0.003, 0.05}};
constexpr LensDistortion kEight = {{0.3, -0.1, 0.002, 0.001, 0.02, 0.5, 0.1, -0.05}};

/// 256 x 200 pixels of 1 mm.
CameraGeometry camera_with(const LensDistortion& lens) {
  PinholeCamera pinhole;
  pinhole.pixels_from_camera << 400, 0, 130.5, 0, 380, 100.25, 0, 0, 1;
  pinhole.translation_mm = {0, 0, 300};
  CameraGeometry camera = camera_from_pinhole("A", pinhole, 1.0, {256, 200});
  camera.distortion = lens;
  return camera;
}

// The oracle is cv2.projectPoints of OpenCV 4.6, which maps pixels of the undistorted image to
// stored ones. Ten decimals were kept.
TEST(LensDistortion, IsOpenCvs) {
  constexpr double kKeptPx = 1e-9;
  const PixelDistortion five(camera_with(kFive));
  EXPECT_LT((five.stored_from_ideal({0, 0}) - Vector2d(7.3283640539, 6.0594997115)).norm(),
            kKeptPx);
  EXPECT_LT((five.stored_from_ideal({255, 0}) - Vector2d(247.4935706871, 6.1365168522)).norm(),
            kKeptPx);
  EXPECT_LT((five.stored_from_ideal({30, 180}) - Vector2d(33.1762046314, 177.5404266266)).norm(),
            kKeptPx);
  const PixelDistortion eight(camera_with(kEight));
  EXPECT_LT((eight.stored_from_ideal({0, 0}) - Vector2d(5.2010095335, 4.0751074401)).norm(),
            kKeptPx);
  EXPECT_LT((eight.stored_from_ideal({200, 50}) - Vector2d(199.3290006173, 50.5351687339)).norm(),
            kKeptPx);
}

TEST(LensDistortion, IdealPixelsComeBack) {
  // Newton stops at 1e-9 px of the stored pixel, where the lens shrinks by at most a half.
  constexpr double kInversePx = 2e-9;
  for (const LensDistortion& lens : {kFive, kEight, LensDistortion{{0.2, 0.1, -0.01, 0.01}}}) {
    const PixelDistortion distortion(camera_with(lens));
    for (const Vector2d& pixel : {Vector2d(0, 0),
                                  Vector2d(255, 199),
                                  Vector2d(130.5, 100.25),
                                  Vector2d(17.5, 160),
                                  Vector2d(240, 3)}) {
      const auto back = distortion.ideal_from_stored(distortion.stored_from_ideal(pixel));
      ASSERT_TRUE(back.has_value());
      EXPECT_LT((*back - pixel).norm(), kInversePx);
    }
  }
}

TEST(LensDistortion, JacobianIsTheDifferenceQuotient) {
  constexpr double kStep = 1e-6;
  constexpr double kTolerance = 1e-8;  // kStep^2 of third derivatives, and rounding by kStep
  for (const LensDistortion& lens : {kFive, kEight})
    for (const Vector2d& at : {Vector2d(0.1, -0.3), Vector2d(-0.32, 0.25)}) {
      Eigen::Matrix2d quotient;
      for (int i = 0; i < 2; ++i) {
        const Vector2d step = kStep * Vector2d::Unit(i);
        quotient.col(i) = (lens.distorted(at + step) - lens.distorted(at - step)) / (2 * kStep);
      }
      EXPECT_LT((lens.jacobian(at) - quotient).norm(), kTolerance);
    }
}

TEST(LensDistortion, FlippedRowsShowTheSame) {
  const CameraGeometry camera = camera_with(kFive);
  CameraGeometry flipped = camera;
  flipped.detector_origin_point +=
      (camera.size_px.y() - 1) * camera.pixel_spacing_mm.y() * camera.row_direction;
  flipped.row_direction = -camera.row_direction;
  flipped.distortion = camera.distortion.with_rows_flipped();
  const Vector2d stored = PixelDistortion(camera).stored_from_ideal({20, 30});
  const Vector2d stored_flipped = PixelDistortion(flipped).stored_from_ideal({20, 199 - 30});
  EXPECT_LT((stored_flipped - Vector2d(stored.x(), 199 - stored.y())).norm(), 1e-9);
}

TEST(LensDistortion, FoldedImagesAreRefused) {
  EXPECT_EQ(distortion_problem(camera_with({})), "");
  EXPECT_EQ(distortion_problem(camera_with(kFive)), "");
  EXPECT_THAT(distortion_problem(camera_with({{-5.0}})), testing::HasSubstr("must not fold"));
  EXPECT_THAT(distortion_problem(camera_with({{-1e5}})), testing::HasSubstr("must not fold"))
      << "the fold is narrower than a step, and beyond it both directions are reversed";
  LensDistortion pole;
  pole.coefficients[5] = -20.0;  // the denominator is 0 within the image
  EXPECT_THAT(distortion_problem(camera_with(pole)), testing::HasSubstr("must not fold"));
  EXPECT_THAT(distortion_problem(camera_with({{1e300}})), testing::HasSubstr("within 1e6"));
  EXPECT_THAT(problems(camera_with({{-5.0}})),
              testing::ElementsAre(testing::HasSubstr("camera 'A': distortion")));
}

TEST(LensDistortion, WhatTheLensShowsNowhereHasNoIdealPixel) {
  // Barrel: r (1 - r^2) is at most 0.385, at r = 0.577.
  const PixelDistortion distortion(camera_with({{-1.0}}));
  EXPECT_FALSE(distortion.ideal_from_stored({130.5 + 0.4 * 400, 100.25}).has_value());
  EXPECT_TRUE(distortion.ideal_from_stored({130.5 + 0.3 * 400, 100.25}).has_value());
}

}  // namespace
}  // namespace af
