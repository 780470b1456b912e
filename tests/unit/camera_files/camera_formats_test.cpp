// SPDX-License-Identifier: Apache-2.0
// What holds for every row of the table of formats.
#include "camera_files/camera_formats.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "camera_files/rig_toml.h"
#include "geometry/rigid_transform.h"
#include "study/rig_file.h"
#include "support/io_checks.h"

namespace af {
namespace {

using Eigen::Vector3d;
using testing::HasSubstr;

// Numbers are written with all their digits; angles and matrices between a camera and its file
// cost some roundings of 1e-16 of 1e3 mm and px, magnified by at most 10.
constexpr double kRoundTripPx = 1e-8;

class EveryCameraFormat : public testing::TestWithParam<const CameraFormat*> {
 protected:
  /// Two oblique cameras whose images are not square, off centre.
  static CameraRig oblique_rig(const Vector3d& isocenter, const Vector3d& shift_mm) {
    CameraRig rig = parse_rig(builtin_rig_text("c-arm-12in"), "c-arm-12in");
    const Eigen::Matrix3d turn = rotation_from_angles({0.2, -0.4, 0.3});
    rig.isocenter_point = isocenter;
    for (CameraGeometry& camera : rig.cameras) {
      camera.source_point = turn * camera.source_point + rig.isocenter_point;
      camera.detector_origin_point =
          turn * (camera.detector_origin_point + shift_mm) + rig.isocenter_point;
      camera.column_direction = turn * camera.column_direction;
      camera.row_direction = turn * camera.row_direction;
      camera.size_px = {251, 240};
    }
    return rig;
  }

  static CameraRig mirrored(CameraRig rig) {
    for (CameraGeometry& camera : rig.cameras) {
      camera.detector_origin_point +=
          camera.pixel_spacing_mm.y() * (camera.size_px.y() - 1) * camera.row_direction;
      camera.row_direction = -camera.row_direction;
    }
    return rig;
  }

  /// The most general of some rigs that the format can state.
  [[nodiscard]] CameraRig writable_rig() const {
    const Vector3d shift(3.0, 4.0, -5.0);
    for (const Vector3d& isocenter : {Vector3d(5.0, -7.0, 11.0), Vector3d(0.0, 0.0, 0.0)}) {
      const CameraRig rig = oblique_rig(isocenter, shift);
      if (can_state(rig)) return rig;
      if (can_state(mirrored(rig))) return mirrored(rig);
    }
    ADD_FAILURE() << "no rig can be written";
    return {};
  }

  [[nodiscard]] bool can_state(const CameraRig& rig) const {
    try {
      (void)camera_files_of(rig, GetParam()->name, "cameras");
      return true;
    } catch (const InputError&) {
      return false;
    }
  }

  /// What the format does not state, and a user would.
  static CameraFileOptions options_for(const CameraRig& rig) {
    CameraFileOptions options;
    options.names = {rig.cameras[0].name, rig.cameras[1].name};
    const Vector3d& point = rig.isocenter_point;
    options.isocenter_point = {point.x(), point.y(), point.z()};
    const CameraGeometry& camera = rig.cameras[0];
    options.size_px = {camera.size_px.x(), camera.size_px.y()};
    options.pixel_spacing_mm = {camera.pixel_spacing_mm.x(), camera.pixel_spacing_mm.y()};
    return options;
  }

  [[nodiscard]] std::vector<std::filesystem::path> written(const CameraRig& rig) const {
    std::vector<std::filesystem::path> paths;
    for (const auto& file : camera_files_of(
             rig, GetParam()->name, folder_ / (std::string("cameras") + GetParam()->extension))) {
      test::write_input(file.path, file.bytes);
      paths.push_back(file.path);
    }
    return paths;
  }

  [[nodiscard]] const test::ScratchFolder& folder() const { return folder_; }

 private:
  test::ScratchFolder folder_;
};

std::vector<const CameraFormat*> all_formats() {
  std::vector<const CameraFormat*> formats;
  for (const CameraFormat& format : camera_formats()) formats.push_back(&format);
  return formats;
}

INSTANTIATE_TEST_SUITE_P(All,
                         EveryCameraFormat,
                         testing::ValuesIn(all_formats()),
                         [](const auto& row) {
                           std::string name = row.param->name;
                           std::erase(name, '-');
                           return name;
                         });

TEST_P(EveryCameraFormat, IsReadBackAsItWasWritten) {
  if (GetParam()->write == nullptr) GTEST_SKIP() << "is not written";
  const CameraRig rig = writable_rig();
  const auto paths = written(rig);
  EXPECT_EQ(paths.size(), GetParam()->holds_one_camera ? 2U : 1U);
  const CameraRig back = read_camera_files(paths, options_for(rig), nullptr);
  ASSERT_EQ(back.cameras.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    const CameraGeometry& camera = rig.cameras[i];
    EXPECT_EQ(back.cameras[i].name, camera.name);
    EXPECT_EQ(back.cameras[i].size_px, camera.size_px);
    for (const Vector3d& offset :
         {Vector3d(0, 0, 0), Vector3d(40, -50, 60), Vector3d(-90, 20, 0)}) {
      const Vector3d point = rig.isocenter_point + offset;
      EXPECT_LT((back.cameras[i].project(point) - camera.project(point)).norm(), kRoundTripPx);
    }
    EXPECT_LT((back.cameras[i].source_point - camera.source_point).norm(), kRoundTripPx);
    EXPECT_GT(back.cameras[i].depth_mm(rig.isocenter_point), 0.0);
  }
}

TEST_P(EveryCameraFormat, IsToldByItsContent) {
  if (GetParam()->write == nullptr) GTEST_SKIP() << "is not written";
  for (const auto& path : written(writable_rig())) {
    const CameraFormat* const found = recognised_camera_format(CameraFile::open(path));
    ASSERT_NE(found, nullptr);
    EXPECT_STREQ(found->name, GetParam()->name);
    int count = 0;
    for (const CameraFormat& format : camera_formats())
      count += format.is_this(CameraFile::open(path)) ? 1 : 0;
    EXPECT_EQ(count, 1) << "the order of the table must not matter";
  }
}

TEST_P(EveryCameraFormat, DamagedCopiesAreReadOrRefused) {
  if (GetParam()->write == nullptr) GTEST_SKIP() << "is not written";
  const auto file = camera_files_of(writable_rig(), GetParam()->name, "cameras").front();
  const std::size_t refused = test::refused_damaged_copies(
      file.bytes, file.bytes.size() / 40 + 1, 200, [&](const std::string& text) {
        test::write_input(folder() / "damaged", text);
        (void)read_camera_files({folder() / "damaged"}, {}, nullptr);
      });
  EXPECT_GT(refused, 30U);
}

TEST_P(EveryCameraFormat, MirroredCamerasAreKeptOrRefused) {
  if (GetParam()->write == nullptr) GTEST_SKIP() << "is not written";
  CameraRig rig = writable_rig();
  if (!rig.cameras[0].is_mirrored()) rig = mirrored(rig);
  std::vector<std::filesystem::path> paths;
  try {
    paths = written(rig);
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("mirrored"));
    return;
  }
  std::vector<std::string> warnings;
  const CameraRig back = read_camera_files(paths, options_for(rig), &warnings);
  EXPECT_THAT(warnings, testing::Contains(HasSubstr("mirrored")));
  const Vector3d point = rig.isocenter_point + Vector3d(40, -50, 60);
  for (std::size_t i = 0; i < 2; ++i)
    EXPECT_LT((back.cameras[i].project(point) - rig.cameras[i].project(point)).norm(),
              kRoundTripPx);
}

TEST_P(EveryCameraFormat, DistortionIsKeptOrRefused) {
  if (GetParam()->write == nullptr) GTEST_SKIP() << "is not written";
  CameraRig rig = writable_rig();
  rig.cameras[0].distortion = {{-0.35, 0.12, 0.004, -0.003, 0.05}};
  rig.cameras[1].distortion = {{0.3, -0.1, 0.002, 0.001, 0.02, 0.5, 0.1, -0.05}};
  if (!GetParam()->states_distortion) {
    EXPECT_FALSE(can_state(rig));
    return;
  }
  const CameraRig back = read_camera_files(written(rig), options_for(rig), nullptr);
  EXPECT_EQ(back.cameras[0].distortion, rig.cameras[0].distortion);
  EXPECT_EQ(back.cameras[1].distortion, rig.cameras[1].distortion);
}

TEST(CameraFormats, RigsAreTakenFromSeveralFilesWithCommas) {
  const test::ScratchFolder folder;
  const CameraRig rig = parse_rig(builtin_rig_text("treatment-room"), "treatment-room");
  std::string names;
  for (const auto& file : camera_files_of(rig, "mayacam2", folder / "cam.txt")) {
    test::write_input(file.path, file.bytes);
    names += (names.empty() ? "" : ",") + file.path.string();
  }
  std::vector<std::string> warnings;
  const CameraRig back = read_rig(names, &warnings);
  ASSERT_EQ(back.cameras.size(), 2U);
  EXPECT_EQ(back.cameras[1].name, "cam-B");
  EXPECT_LT(back.isocenter_point.norm(), 1e-9 + 0.4);  // the middle of 512 pixels is between two
  EXPECT_THAT(warnings, testing::Contains(HasSubstr("nearest to the 2 central rays")));
  EXPECT_THAT(test::message_of<FileError>([&] { (void)read_rig(names + ",absent.txt"); }),
              HasSubstr("absent.txt: no such file"));
}

TEST(CameraFormats, UnknownFilesAndNamesAreRefused) {
  const test::ScratchFolder folder;
  test::write_input(folder / "prose.txt", "A file of no cameras.\n");
  EXPECT_THAT(test::message_of<FileError>(
                  [&] { (void)read_camera_files({folder / "prose.txt"}, {}, nullptr); }),
              HasSubstr("states no camera in a known format; tried: rig, "));
  EXPECT_THROW((void)camera_files_of({}, "no-such-format", ""), InputError);
  CameraFileOptions options;
  options.format = "mayacam2";
  EXPECT_THROW((void)read_camera_files({folder / "prose.txt"}, options, nullptr), FileError);
}

}  // namespace
}  // namespace af
