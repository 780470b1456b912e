// SPDX-License-Identifier: Apache-2.0
#include "study/xray_reader.h"

#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "image_files/image_file.h"
#include "support/test_paths.h"

namespace af {
namespace {

using test::ScratchFolder;
using testing::HasSubstr;

/// Single-precision rounding of a logarithm of at most 10.
constexpr float kLogRounding = 1e-6f;

CameraGeometry camera(int columns, int rows) {
  CameraGeometry geometry;
  geometry.name = "A";
  geometry.size_px = {columns, rows};
  return geometry;
}

/// A 40 x 50 image of open beam 4000 with three darker pixels in the first row.
Image2d intensities() {
  Image2d image(40, 50);
  std::fill(image.pixels.begin(), image.pixels.end(), 4000.0f);
  image.at(0, 0) = 1000.0f;
  image.at(1, 0) = 1.0f;
  image.at(2, 0) = 0.0f;
  return image;
}

StudyView view_of(const ScratchFolder& folder,
                  const Image2d& image,
                  XrayDomain domain = XrayDomain::Intensity) {
  write_image(image, folder / "xray.mha", 0.4, 0.4);
  StudyView view;
  view.camera = "A";
  view.xray = folder / "xray.mha";
  view.xray_domain = domain;
  return view;
}

TEST(XrayReader, TakesTheNegativeLogarithmRelativeToTheOpenBeam) {
  const ScratchFolder folder;
  const Image2d found = read_xray_attenuation(view_of(folder, intensities()), camera(40, 50));
  EXPECT_NEAR(found.at(0, 0), std::log(4.0f), kLogRounding);
  EXPECT_NEAR(found.at(1, 0), std::log(4000.0f), kLogRounding);
  EXPECT_NEAR(found.at(2, 0), std::log(8000.0f), kLogRounding) << "zero is half a level";
  EXPECT_EQ(found.at(3, 0), 0.0f);
}

TEST(XrayReader, TakesThe999thPermilleAsOpenBeamSoThatSinglePixelsDoNotDecide) {
  const ScratchFolder folder;
  Image2d image = intensities();
  image.at(5, 5) = 65535.0f;  // one of 2000 pixels
  const Image2d found = read_xray_attenuation(view_of(folder, image), camera(40, 50));
  EXPECT_EQ(found.at(3, 0), 0.0f);
  EXPECT_LT(found.at(5, 5), 0.0f);
}

TEST(XrayReader, LeavesAttenuationAsItIs) {
  const ScratchFolder folder;
  Image2d image(2, 2);
  image.pixels = {0.0f, 1.5f, -0.25f, 7.0f};
  const auto view = view_of(folder, image, XrayDomain::Attenuation);
  EXPECT_EQ(read_xray_attenuation(view, camera(2, 2)).pixels, image.pixels);
}

void expect_refused(const StudyView& view, const CameraGeometry& geometry, const char* message) {
  try {
    (void)read_xray_attenuation(view, geometry);
    FAIL() << "accepted; expected: " << message;
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr(message));
    EXPECT_THAT(error.what(), HasSubstr("xray.mha"));
  }
}

TEST(XrayReader, RefusesAnotherSizeAConstantImageAndImpossibleValues) {
  const ScratchFolder folder;
  expect_refused(view_of(folder, intensities()), camera(50, 40), "40 x 50 px");
  Image2d image(40, 50);
  expect_refused(view_of(folder, image), camera(40, 50), "constant image");
  image = intensities();
  image.at(7, 3) = -1.0f;
  expect_refused(view_of(folder, image), camera(40, 50), "pixel (7, 3) = -1");
  image.at(7, 3) = std::numeric_limits<float>::quiet_NaN();
  expect_refused(view_of(folder, image), camera(40, 50), "must be finite");
  image = Image2d(40, 50);
  image.at(0, 0) = 1.0f;
  expect_refused(view_of(folder, image), camera(40, 50), "open-beam intensity");
}

TEST(XrayReader, RefusesAMissingFileAsAFileError) {
  StudyView view;
  view.xray = "/nonexistent/xray.mha";
  EXPECT_THROW((void)read_xray_attenuation(view, camera(2, 2)), FileError);
}

TEST(MaskReader, IsEmptyWithoutAMaskAndRefusesOneThatHidesEverything) {
  const ScratchFolder folder;
  StudyView view = view_of(folder, intensities());
  EXPECT_TRUE(read_mask(view, camera(40, 50)).pixels.empty());
  Image2d mask(40, 50);
  write_png_image(mask, folder / "mask.png", 0, 1);
  view.mask = folder / "mask.png";
  EXPECT_THROW((void)read_mask(view, camera(40, 50)), InputError);
  mask.at(3, 4) = 1.0f;
  write_png_image(mask, folder / "mask.png", 0, 1);
  EXPECT_NE(read_mask(view, camera(40, 50)).at(3, 4), 0.0f);
  EXPECT_THROW((void)read_mask(view, camera(40, 51)), InputError);
}

}  // namespace
}  // namespace af
