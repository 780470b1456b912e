// SPDX-License-Identifier: Apache-2.0
#include "camera_files/stated_rig.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "camera_files/rig_toml.h"
#include "support/io_checks.h"

namespace af {
namespace {

using Eigen::Vector3d;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr double kCompletionMm = 1e-9;

/// The cameras of c-arm-12in as a file that states nothing but their rays would give them.
StatedRig rays_only(const std::string& file = "dir/cam.txt") {
  StatedRig stated;
  stated.file = file;
  for (const CameraGeometry& camera :
       parse_rig(builtin_rig_text("c-arm-12in"), "c-arm-12in").cameras)
    stated.cameras.push_back({.geometry = camera, .has_name = true, .has_spacing = false});
  return stated;
}

TEST(StatedRig, TakesTheNearestPointOfTheCentralRaysForTheIsocentre) {
  std::vector<std::string> warnings;
  const CameraRig rig = completed_rig({rays_only()}, {}, &warnings);
  EXPECT_LT(rig.isocenter_point.norm(), kCompletionMm);
  // 1.5 times the 650 mm from the source.
  EXPECT_NEAR(rig.cameras[0].source_detector_distance_mm(), 975.0, kCompletionMm);
  EXPECT_THAT(warnings,
              ElementsAre(HasSubstr("isocentre"), HasSubstr("pixel spacing"), HasSubstr("LAT")));
}

TEST(StatedRig, OfSkewCentralRaysTheMiddleOfTheirShortestSegmentIsTheIsocentre) {
  StatedRig stated = rays_only();
  CameraGeometry& lat = stated.cameras[1].geometry;
  lat.source_point.z() += 4.0;
  lat.detector_origin_point.z() += 4.0;
  const CameraRig rig = completed_rig({stated}, {}, nullptr);
  EXPECT_LT((rig.isocenter_point - Vector3d(0, 0, 2)).norm(), kCompletionMm);
}

TEST(StatedRig, OptionsStateWhatFilesLeaveOpen) {
  StatedRig stated = rays_only();
  for (StatedCamera& camera : stated.cameras) camera.has_size = false;
  CameraFileOptions options;
  options.names = {"one", "two"};
  options.size_px = {300, 200};
  options.pixel_spacing_mm = {1.190625, 1.190625};
  options.isocenter_point = {1, 2, 3};
  std::vector<std::string> warnings;
  const CameraRig rig = completed_rig({stated}, options, &warnings);
  EXPECT_TRUE(warnings.empty());
  EXPECT_EQ(rig.cameras[1].name, "two");
  EXPECT_EQ(rig.cameras[0].size_px, Eigen::Vector2i(300, 200));
  EXPECT_EQ(rig.isocenter_point, Vector3d(1, 2, 3));
  EXPECT_NEAR(rig.cameras[0].source_detector_distance_mm(), 1020.0, kCompletionMm);
}

TEST(StatedRig, UnitsScaleTheRoomNotTheDetector) {
  CameraFileOptions options;
  options.unit_mm = 10.0;
  options.pixel_spacing_mm = {1.190625, 1.190625};
  const CameraRig rig = completed_rig({rays_only()}, options, nullptr);
  EXPECT_LT((rig.cameras[0].source_point - Vector3d(0, -6500, 0)).norm(), kCompletionMm);
  EXPECT_NEAR(rig.cameras[0].source_detector_distance_mm(), 1020.0, kCompletionMm);
}

TEST(StatedRig, CamerasAreNamedAfterTheirFiles) {
  StatedRig first = rays_only("dir/cam 1.txt");
  first.cameras.resize(1);
  first.cameras[0].has_name = false;
  StatedRig second = rays_only("other/cam 1.txt");
  second.cameras.erase(second.cameras.begin());
  second.cameras[0].has_name = false;
  const CameraRig rig = completed_rig({first, second}, {}, nullptr);
  EXPECT_EQ(rig.cameras[0].name, "cam_1");
  EXPECT_EQ(rig.cameras[1].name, "cam_1-2");
}

TEST(StatedRig, AsksForWhatIsMissingByName) {
  const auto refusal = [](const std::vector<StatedRig>& stated, const CameraFileOptions& options) {
    return test::message_of<InputError>([&] { (void)completed_rig(stated, options, nullptr); });
  };
  StatedRig stated = rays_only();
  stated.cameras[1].has_size = false;
  EXPECT_THAT(refusal({stated}, {}), HasSubstr("camera 'LAT': the size"));

  // A camera that is its own frame: its central ray begins at the origin.
  StatedRig lone = rays_only();
  lone.cameras.resize(1);
  CameraGeometry& camera = lone.cameras[0].geometry;
  camera.detector_origin_point -= camera.source_point;
  camera.source_point.setZero();
  EXPECT_THAT(refusal({lone}, {}), HasSubstr("--rig-isocenter-point"));
  EXPECT_THAT(refusal({}, {}), HasSubstr("no camera"));
}

TEST(StatedRig, RefusesWhatContradictsTheFiles) {
  const auto refusal = [](const StatedRig& stated, const auto& change) {
    CameraFileOptions options;
    change(options);
    return test::message_of<InputError>([&] { (void)completed_rig({stated}, options, nullptr); });
  };
  const StatedRig stated = rays_only();
  EXPECT_THAT(refusal(stated,
                      [](auto& options) {
                        options.size_px = {1, 2};
                      }),
              HasSubstr("--rig-size-px"));
  EXPECT_THAT(refusal(stated, [](auto& options) { options.names = {"one"}; }),
              HasSubstr("as many as there are cameras: 2"));
  EXPECT_THAT(refusal(stated,
                      [](auto& options) {
                        options.names = {"one", "a/b"};
                      }),
              HasSubstr("file name"));
  EXPECT_THAT(refusal(stated,
                      [](auto& options) {
                        options.names = {"one", "one"};
                      }),
              HasSubstr("unique"));
  EXPECT_THAT(refusal(stated,
                      [](auto& options) {
                        options.pixel_spacing_mm = {0.5, 0.6};
                      }),
              HasSubstr("must agree with the file"));
  EXPECT_THAT(refusal(stated,
                      [](auto& options) {
                        options.isocenter_point = {0, -2000, 0};
                      }),
              HasSubstr("in front of the source"));
  StatedRig known = stated;
  known.isocenter_point = Vector3d(0, 0, 0);
  EXPECT_THAT(refusal(known,
                      [](auto& options) {
                        options.isocenter_point = {0, 0, 1};
                      }),
              HasSubstr("must be that of"));
  for (StatedCamera& camera : known.cameras) camera.has_spacing = true;
  EXPECT_THAT(refusal(known,
                      [](auto& options) {
                        options.pixel_spacing_mm = {0.5, 0.5};
                      }),
              HasSubstr("--rig-pixel-spacing-mm"));
  EXPECT_THAT(refusal(known, [](auto& options) { options.unit_mm = 10.0; }),
              HasSubstr("lengths are mm"));
}

}  // namespace
}  // namespace af
