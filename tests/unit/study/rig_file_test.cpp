// SPDX-License-Identifier: Apache-2.0
#include "study/rig_file.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "base/hash_random.h"
#include "geometry/rigid_transform.h"
#include "support/io_checks.h"

namespace af {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using test::message_of;
using test::replaced;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

// A shipped rig's numbers carry 16 digits: lengths up to 4000 mm round by 5e-13 mm each.
constexpr double kLengthToleranceMm = 1e-11;
constexpr double kPixelTolerance = 1e-10;

void expect_identical(const CameraGeometry& a, const CameraGeometry& b) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.source_point, b.source_point);
  EXPECT_EQ(a.detector_origin_point, b.detector_origin_point);
  EXPECT_EQ(a.column_direction, b.column_direction);
  EXPECT_EQ(a.row_direction, b.row_direction);
  EXPECT_EQ(a.pixel_spacing_mm, b.pixel_spacing_mm);
  EXPECT_EQ(a.size_px, b.size_px);
}

class RigFile : public testing::Test {
 protected:
  CameraRig read(const std::string& text) {
    test::write_input(path(), text);
    return read_rig(path(), &warnings_);
  }
  std::string input_refusal(const std::string& text) {
    return message_of<InputError>([&] { read(text); });
  }
  std::string file_refusal(const std::string& text) {
    return message_of<FileError>([&] { read(text); });
  }
  [[nodiscard]] std::string path() const { return folder_ / "rig.toml"; }
  [[nodiscard]] const std::vector<std::string>& warnings() const { return warnings_; }
  [[nodiscard]] const test::ScratchFolder& folder() const { return folder_; }

  const std::string good_ = builtin_rig_text("c-arm-12in");

 private:
  test::ScratchFolder folder_;
  std::vector<std::string> warnings_;
};

class BuiltinRig : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(All, BuiltinRig, testing::Values("c-arm-12in", "treatment-room"));

TEST_P(BuiltinRig, IsReadWithoutWarningsAndCentresTheIsocentre) {
  std::vector<std::string> warnings;
  const CameraRig rig = read_rig(GetParam(), &warnings);
  EXPECT_THAT(warnings, IsEmpty());
  EXPECT_THAT(problems(rig), IsEmpty());
  for (const CameraGeometry& camera : rig.cameras) {
    const Vector2d center = 0.5 * (camera.size_px.cast<double>() - Vector2d::Ones());
    EXPECT_LT((camera.project(rig.isocenter_point) - center).norm(), kPixelTolerance);
    EXPECT_EQ(camera.row_direction, Vector3d(0.0, 0.0, -1.0));  // row 0 is the head's side
    EXPECT_LT(camera.source_point.y() / camera.source_point.norm(), 0.1);  // never from below
  }
}

TEST_F(RigFile, MatricesThatStateEverythingAreARig) {
  // K (R | t) with K of focal length 1000 and (255.5, 199.5), R = (e_x, -e_z, e_y), t = (0, 0,
  // 800).
  const std::string stated =
      "# isocenter_point 0 0 0\n# camera AP\n# size_px 512 400\n# pixel_spacing_mm 0.5 0.5\n";
  for (const char* rows :
       {"1000 255.5 0 204400\n0 199.5 -1000 159600\n0 1 0 800\n",
        "-1000,-255.5,0,-204400,0,-199.5,1000,-159600,0,-1,0,-800\n",
        "[[2000, 511, 0, 408800],\r\n[0, 399, -2000, 319200],\r\n[0, 2, 0, 1600]]\r\n"}) {
    test::write_input(folder() / "matrices.txt", stated + rows);
    const CameraRig rig = read_rig(folder() / "matrices.txt");
    EXPECT_EQ(rig.cameras.front().name, "AP");
    EXPECT_LT((rig.cameras.front().source_point - Vector3d(0, -800, 0)).norm(), 1e-9);
    EXPECT_LT((rig.cameras.front().project({10, 20, 30}) -
               Vector2d(255.5 + 1000.0 * 10 / 820, 199.5 - 1000.0 * 30 / 820))
                  .norm(),
              kPixelTolerance);
  }
}

TEST_F(RigFile, FilesOfOtherProgramsAreRefusedWithTheCommandThatConvertsThem) {
  const std::string cameras = folder() / "cam.txt";
  for (const char* text : {"image size\n64,48\n", "1 0 0 5\n0 1 0 6\n0 0 1 7\n", "prose"}) {
    test::write_input(cameras, text);
    EXPECT_THAT(message_of<InputError>([&] { (void)read_rig(cameras); }),
                HasSubstr("af-convert " + cameras + " -o rig.toml"));
  }
  EXPECT_THAT(message_of<InputError>([&] { (void)read_rig(cameras + "," + cameras); }),
              HasSubstr("af-convert " + cameras + " " + cameras + " -o rig.toml"));
}

TEST_P(BuiltinRig, CamerasAreOrthogonal) {
  const CameraRig rig = read_rig(GetParam());
  ASSERT_EQ(rig.cameras.size(), 2U);
  EXPECT_NEAR(rig.cameras[0].beam_direction().dot(rig.cameras[1].beam_direction()), 0.0, 1e-15);
}

TEST_P(BuiltinRig, RoundTripKeepsEveryBit) {
  const test::ScratchFolder folder;
  const CameraRig rig = read_rig(GetParam());
  test::write_input(folder / "rig.toml", rig_to_toml(rig));
  const CameraRig back = read_rig(folder / "rig.toml");
  EXPECT_EQ(back.isocenter_point, rig.isocenter_point);
  ASSERT_EQ(back.cameras.size(), rig.cameras.size());
  for (std::size_t i = 0; i < rig.cameras.size(); ++i)
    expect_identical(back.cameras[i], rig.cameras[i]);
}

TEST(BuiltinRigs, HaveTheContractsNumbers) {
  EXPECT_THAT(builtin_rig_names(), ElementsAre("c-arm-12in", "treatment-room"));
  const CameraRig c_arm = read_rig("c-arm-12in");
  EXPECT_EQ(c_arm.camera("AP").source_point, Vector3d(0.0, -650.0, 0.0));
  EXPECT_EQ(c_arm.camera("LAT").detector_origin_point, Vector3d(-370.0, -151.8046875, 151.8046875));
  EXPECT_NEAR(c_arm.camera("AP").source_detector_distance_mm(), 1020.0, kLengthToleranceMm);

  const CameraRig room = read_rig("treatment-room");
  const double h = std::sqrt(0.5);
  EXPECT_LT((room.camera("A").beam_direction() - Vector3d(h, h, 0.0)).norm(), 1e-15);
  EXPECT_LT((room.camera("B").beam_direction() - Vector3d(-h, h, 0.0)).norm(), 1e-15);
  for (const CameraGeometry& camera : room.cameras) {
    EXPECT_NEAR(camera.source_point.norm(), 2600.0, kLengthToleranceMm);
    EXPECT_NEAR(camera.source_detector_distance_mm(), 3600.0, kLengthToleranceMm);
    EXPECT_LT(
        (camera.column_direction.cross(camera.row_direction) - camera.beam_direction()).norm(),
        1e-15);
    EXPECT_EQ(camera.size_px, Eigen::Vector2i(512, 512));
    EXPECT_EQ(camera.pixel_spacing_mm, Vector2d(0.4, 0.4));
  }
}

TEST(BuiltinRigs, UnknownNameListsTheShippedOnes) {
  EXPECT_THAT(message_of<FileError>([] { read_rig("c-arm"); }),
              AllOf(HasSubstr("c-arm-12in"), HasSubstr("treatment-room")));
  EXPECT_THROW(builtin_rig_text("c-arm"), InputError);
  EXPECT_THROW(read_rig(""), InputError);
}

TEST_F(RigFile, RoundTripOfRandomCamerasKeepsEveryBit) {
  HashRandom random(1);
  for (int i = 0; i < 50; ++i) {
    CameraRig rig;
    rig.isocenter_point =
        Vector3d(random.uniform(), 1e6 * random.uniform(), -1e-20 * random.uniform());
    const Eigen::Matrix3d axes = rotation_from_angles(
        {random.uniform(-3.0, 3.0), random.uniform(-3.0, 3.0), random.uniform(-3.0, 3.0)});
    CameraGeometry camera;
    camera.name = "quote \" backslash \\ µ";
    camera.source_point = 1000.0 * axes.col(2) * random.uniform(0.5, 1.0);
    camera.detector_origin_point = -1000.0 * axes.col(2) * random.uniform(0.5, 1.0);
    camera.column_direction = axes.col(0);
    camera.row_direction = axes.col(1);
    camera.pixel_spacing_mm = {random.uniform(0.1, 1.0), random.uniform(0.1, 1.0)};
    camera.size_px = {1, 32768};
    rig.cameras = {camera};
    const CameraRig back = read(rig_to_toml(rig));
    EXPECT_EQ(back.isocenter_point, rig.isocenter_point);
    expect_identical(back.cameras.at(0), camera);
  }
}

TEST_F(RigFile, AxesWrittenWithFewDigitsAreMadeExactlyUnitAndOrthogonal) {
  const CameraGeometry camera = read(replaced(good_,
                                              "column_direction = [1.0, 0.0, 0.0]",
                                              "column_direction = [1.000004, 0, 4e-6]"))
                                    .camera("AP");
  EXPECT_NEAR(camera.column_direction.norm(), 1.0, 1e-15);
  EXPECT_NEAR(camera.row_direction.norm(), 1.0, 1e-15);
  EXPECT_NEAR(camera.column_direction.dot(camera.row_direction), 0.0, 1e-15);
}

TEST_F(RigFile, MirroredCameraIsReadWithAWarning) {
  const CameraRig rig = read(
      replaced(good_, "column_direction = [1.0, 0.0, 0.0]", "column_direction = [-1.0, 0.0, 0.0]"));
  EXPECT_TRUE(rig.camera("AP").is_mirrored());
  EXPECT_THAT(warnings(), ElementsAre(AllOf(HasSubstr(path() + ":5: camera 'AP': mirrored"))));
}

TEST_F(RigFile, ProjectionMatrixCameraHasTheRaysOfTheMatrix) {
  // f = 1000 mm / 0.5 mm = 2000 px, centre (128, 64), source 700 mm in front, rows towards the
  // feet.
  const std::string text = R"(isocenter_point = [0, 0, 0]
[[camera]]
name = "M"
projection_matrix = [[2000, 128, 0, 89600], [0, 64, -2000, 44800], [0, 1, 0, 700]]
pixel_spacing_mm = [0.5, 0.5]
size_px = [256, 128]
)";
  for (const bool negated : {false, true}) {
    const std::string matrix =
        negated ? replaced(text,
                           "[[2000, 128, 0, 89600], [0, 64, -2000, 44800], [0, 1, 0, 700]]",
                           "[[-2000, -128, 0, -89600], [0, -64, 2000, -44800], [0, -1, 0, -700]]")
                : text;
    const CameraGeometry camera = read(matrix).camera("M");
    EXPECT_LT((camera.source_point - Vector3d(0.0, -700.0, 0.0)).norm(), kLengthToleranceMm);
    EXPECT_LT((camera.project({0.0, 0.0, 0.0}) - Vector2d(128.0, 64.0)).norm(), kPixelTolerance);
    EXPECT_LT((camera.project({7.0, 0.0, 7.0}) - Vector2d(148.0, 44.0)).norm(), kPixelTolerance);
    EXPECT_NEAR(camera.source_detector_distance_mm(), 1000.0, 1e-9);
    EXPECT_THAT(warnings(), IsEmpty());
  }
}

TEST_F(RigFile, ProjectionMatrixBesideGeometryKeysIsRefused) {
  const std::string message = input_refusal(R"(isocenter_point = [0, 0, 0]
[[camera]]
name = "M"
source_point = [0, -700, 0]
projection_matrix = [[2000, 128, 0, 89600], [0, 64, -2000, 44800], [0, 1, 0, 700]]
pixel_spacing_mm = [0.5, 0.5]
size_px = [256, 128]
)");
  EXPECT_THAT(
      message,
      HasSubstr(":4: camera[0].source_point = [0, -700, 0]: must not be given together with"));
}

TEST_F(RigFile, SingularProjectionMatrixIsRefusedAtItsLine) {
  const std::string message = input_refusal(R"(isocenter_point = [0, 0, 0]
[[camera]]
name = "M"
projection_matrix = [[2000, 128, 0, 89600], [2000, 128, 0, 0], [0, 1, 0, 700]]
pixel_spacing_mm = [0.5, 0.5]
size_px = [256, 128]
)");
  EXPECT_THAT(message, AllOf(HasSubstr(path() + ":4: "), HasSubstr("singular")));
}

TEST_F(RigFile, BadValuesAreRefusedWithLineKeyValueAndConstraint) {
  EXPECT_THAT(input_refusal(replaced(good_, "[1.0, 0.0, 0.0]", "[1.1, 0.0, 0.0]")),
              HasSubstr(":9: camera 'AP': column_direction = [1.1, 0, 0]: must have length 1"));
  EXPECT_THAT(input_refusal(replaced(good_, "[0.0, 0.0, -1.0]", "[0.8, 0.0, -0.6]")),
              AllOf(HasSubstr(":10: camera 'AP': row_direction"), HasSubstr("orthogonal")));
  EXPECT_THAT(
      input_refusal(replaced(good_, "[0.0, -650.0, 0.0]", "[0.0, 370.0, 0.0]")),
      HasSubstr(":7: camera 'AP': source_point = [0, 370, 0]: must not lie on the detector"));
  EXPECT_THAT(
      input_refusal(replaced(good_, "\"LAT\"", "\"AP\"")),
      AllOf(HasSubstr(":14: camera name = \"AP\": must be unique"), HasSubstr("rig.toml:5")));
  EXPECT_THAT(
      input_refusal(replaced(good_, "[256, 256]", "[256.5, 256]")),
      HasSubstr(":12: camera[0].size_px = [256.5, 256]: must be a list of 2 whole numbers"));
  EXPECT_THAT(input_refusal(replaced(good_, "[256, 256]", "[256, 99999999999999]")),
              HasSubstr("whole numbers"));
  EXPECT_THAT(input_refusal(replaced(good_, "[256, 256]", "[256, 1000000]")),
              HasSubstr("must be between 1 and 32768"));
  EXPECT_THAT(input_refusal(replaced(good_, "[1.190625, 1.190625]", "[0, -1]")),
              HasSubstr("pixel_spacing_mm = [0, -1]: must be 0.01 to 100 mm"));
  EXPECT_THAT(input_refusal(replaced(good_, "[1.190625, 1.190625]", "[nan, inf]")),
              HasSubstr("pixel_spacing_mm = [nan, inf]: must be a list of 2 finite numbers"));
  EXPECT_THAT(input_refusal(replaced(good_, "[0.0, -650.0, 0.0]", "\"front\"")),
              HasSubstr("source_point = \"front\": must be a list of 3 finite numbers"));
  EXPECT_THAT(input_refusal(replaced(good_, "\"AP\"", "\"\"")), HasSubstr("name = \"\""));
  EXPECT_THAT(input_refusal(replaced(good_, "\"AP\"", "\"a/b\"")),
              HasSubstr("usable in a file name"));
  EXPECT_THAT(input_refusal(replaced(good_, "\"AP\"", "7")), HasSubstr("name = 7: must be text"));
}

TEST_F(RigFile, DistortionIsOpenCvsFourFiveOrEightNumbers) {
  const auto with = [&](const std::string& numbers) {
    return replaced(
        good_, "size_px = [256, 256]", "size_px = [256, 256]\ndistortion = [" + numbers + "]");
  };
  const CameraRig rig = parse_rig(with("-0.2, 0.1, 0.001, 0.002"), "rig.toml");
  EXPECT_EQ(rig.cameras[0].distortion, (LensDistortion{{-0.2, 0.1, 0.001, 0.002}}));
  EXPECT_TRUE(rig.cameras[1].distortion.is_none());
  EXPECT_EQ(parse_rig(rig_to_toml(rig), "rig.toml").cameras[0].distortion,
            rig.cameras[0].distortion);
  const CameraRig rational = parse_rig(with("0.1, 0, 0, 0, 0, 0.2, 0.1, 0.01"), "rig.toml");
  EXPECT_EQ(parse_rig(rig_to_toml(rational), "rig.toml").cameras[0].distortion,
            rational.cameras[0].distortion);
  EXPECT_THAT(input_refusal(with("1, 2, 3")), HasSubstr("must be OpenCV's k1, k2, p1, p2"));
  EXPECT_THAT(input_refusal(with("1, 2, 3, \"x\"")), HasSubstr("must be finite numbers"));
  EXPECT_THAT(input_refusal(with("-50, 0, 0, 0")), HasSubstr("must not fold the image"));
}

TEST_F(RigFile, UnknownKeyIsRefusedWithTheNearestName) {
  EXPECT_THAT(
      input_refusal(replaced(good_, "row_direction =", "row_directoin =")),
      AllOf(HasSubstr("camera[0]: unknown key \"row_directoin\": did you mean \"row_direction\"?"),
            HasSubstr("row_direction is missing")));
  EXPECT_THAT(input_refusal("qwertyuiop = 1\n" + good_),
              AllOf(HasSubstr(":1: unknown key \"qwertyuiop\""), Not(HasSubstr("did you mean"))));
}

TEST_F(RigFile, AllProblemsAreReportedInTheOrderOfTheFile) {
  std::string text = replaced(good_, "isocenter_point = [0.0, 0.0, 0.0]", "isocenter_point = 1");
  text = replaced(text, "[0.0, -650.0, 0.0]", "[]");
  text = replaced(text, "[650.0, 0.0, 0.0]", "[1, 2]");
  const std::string message = input_refusal(text);
  const std::size_t first = message.find("isocenter_point");
  const std::size_t second = message.find("camera[0].source_point");
  const std::size_t third = message.find("camera[1].source_point");
  EXPECT_LT(first, second);
  EXPECT_LT(second, third);
  EXPECT_NE(third, std::string::npos);
}

TEST_F(RigFile, RigWithoutCamerasIsRefused) {
  EXPECT_THAT(input_refusal("isocenter_point = [0, 0, 0]\n"), HasSubstr("camera is missing"));
  EXPECT_THAT(input_refusal("isocenter_point = [0, 0, 0]\ncamera = []\n"), HasSubstr("[[camera]]"));
  EXPECT_THAT(input_refusal("isocenter_point = [0, 0, 0]\ncamera = [1]\n"),
              HasSubstr("[[camera]]"));
  EXPECT_THAT(input_refusal("isocenter_point = [0, 0, 0]\ncamera = 3\n"), HasSubstr("[[camera]]"));
}

TEST_F(RigFile, WhatIsNotTomlIsAFileErrorWithItsPlace) {
  EXPECT_THAT(file_refusal("a = = 1\n"), HasSubstr(path() + ":1:5: is not valid TOML"));
  EXPECT_THAT(file_refusal(""), HasSubstr("is empty"));
  EXPECT_THAT(file_refusal(" \n\n"), HasSubstr("is empty"));
  EXPECT_THAT(file_refusal(std::string("\x89PNG\r\n\x1a\n\0\0\0\rIHDR", 16)),
              HasSubstr("is not valid TOML"));
  EXPECT_THROW(read_rig(folder().path().string()), FileError);
  EXPECT_THROW(read_rig(folder() / "missing.toml"), FileError);
}

TEST_F(RigFile, DeepNestingIsRefusedInsteadOfExhaustingTheStack) {
  EXPECT_THROW(read("a = " + std::string(100'000, '[') + std::string(100'000, ']')), FileError);
  std::string dotted = "a";
  for (int i = 0; i < 200'000; ++i) dotted += ".a";
  EXPECT_THROW(read(dotted + " = 1"), FileError);
  EXPECT_THROW(read("[" + dotted + "]"), FileError);
  std::string tables = "x = ";
  for (int i = 0; i < 100'000; ++i) tables += "{a=";
  EXPECT_THROW(read(tables), FileError);
}

TEST_F(RigFile, DamagedFilesAreReadOrRefused) {
  const std::size_t refused =
      test::refused_damaged_copies(good_, 7, 1000, [&](const std::string& text) { read(text); });
  EXPECT_GT(refused, 300U);
}

}  // namespace
}  // namespace af
