// SPDX-License-Identifier: Apache-2.0
#include "register/problem/fiducial_mask.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "unit/register/method/registration_cases.h"

namespace af::registration {
namespace {

std::ptrdiff_t hidden_pixels(const Image2d& mask) {
  return std::count(mask.pixels.begin(), mask.pixels.end(), 0.0f);
}

TEST(FiducialMask, HidesPixelCentresWithinTheRadius) {
  const CameraGeometry camera = test::small_camera(false);
  const Image2d mask = mask_fiducials({}, camera, {{20.0, 10.0}}, 2.0);
  ASSERT_EQ(mask.width, camera.size_px.x());
  ASSERT_EQ(mask.height, camera.size_px.y());
  // Gauss's circle problem: 13 lattice points lie within 2 of the origin.
  EXPECT_EQ(hidden_pixels(mask), 13);
  EXPECT_EQ(mask.at(22, 10), 0.0f);
  EXPECT_EQ(mask.at(20, 8), 0.0f);
  EXPECT_EQ(mask.at(22, 11), 1.0f);
}

TEST(FiducialMask, AddsToAGivenMask) {
  const CameraGeometry camera = test::small_camera(false);
  Image2d given(camera.size_px.x(), camera.size_px.y());
  given.at(5, 5) = 7.0f;
  given.at(30, 30) = 7.0f;
  const Image2d mask = mask_fiducials(given, camera, {{5.4, 5.0}}, 0.5);
  EXPECT_EQ(mask.at(5, 5), 0.0f);
  EXPECT_EQ(mask.at(30, 30), 7.0f);
}

TEST(FiducialMask, CutsDiscsAtTheDetectorsEdges) {
  const CameraGeometry camera = test::small_camera(false);
  // A quarter of the disc lies on the detector: (0,0), (1,0), (0,1), (1,1), (2,0), (0,2).
  EXPECT_EQ(hidden_pixels(mask_fiducials({}, camera, {{0.0, 0.0}}, 2.0)), 6);
  EXPECT_EQ(hidden_pixels(mask_fiducials({}, camera, {{-40.0, 1e9}}, 2.0)), 0);
}

TEST(FiducialMask, OfNoFiducialOrNoRadiusIsTheGivenOne) {
  const CameraGeometry camera = test::small_camera(false);
  EXPECT_TRUE(mask_fiducials({}, camera, {}, 4.0).pixels.empty());
  EXPECT_TRUE(mask_fiducials({}, camera, {{20.0, 10.0}}, 0.0).pixels.empty());
}

}  // namespace
}  // namespace af::registration
