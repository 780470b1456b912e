// SPDX-License-Identifier: Apache-2.0
// The worked examples of docs/cameras.md: files as other programs write them, and where their
// cameras see a point, computed by hand or by the other program.
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "camera_files/camera_formats.h"
#include "camera_files/format_readers.h"
#include "hdf5_files/hdf5_output.h"
#include "support/io_checks.h"
#include "unit/image_files/dicom_test_file.h"

namespace af {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using testing::HasSubstr;

// The closed forms below have 1e-15 of 1e3 px, and so has the camera.
constexpr double kConventionPx = 1e-9;

class CameraConventions : public testing::Test {
 protected:
  CameraRig read(const std::string& text, const CameraFileOptions& options = {}) {
    test::write_input(folder_ / "camera.txt", text);
    return read_camera_files({folder_ / "camera.txt"}, options, &warnings_);
  }
  CameraGeometry camera(const std::string& text, const CameraFileOptions& options = {}) {
    return read(text, options).cameras.front();
  }
  std::string input_refusal(const std::string& text) {
    return test::message_of<InputError>([&] { (void)read(text); });
  }
  std::string file_refusal(const std::string& text) {
    return test::message_of<FileError>([&] { (void)read(text); });
  }
  static void expect_seen(const CameraGeometry& camera, const Vector3d& point, const Vector2d& at) {
    EXPECT_LT((camera.project(point) - at).norm(), kConventionPx)
        << camera.project(point).transpose() << " instead of " << at.transpose();
  }
  [[nodiscard]] const std::vector<std::string>& warnings() const { return warnings_; }

 private:
  test::ScratchFolder folder_;
  std::vector<std::string> warnings_;
};

constexpr const char* kMayaCam2 =
    "image size\n1024,768\n\ncamera matrix\n5000,0,511.5\n0,5000,383.5\n0,0,1\n\n"
    "rotation\n0,1,0\n0,0,-1\n-1,0,0\n\ntranslation\n0\n0\n1000\n";

TEST_F(CameraConventions, MayaCam2) {
  const CameraGeometry read = camera(kMayaCam2);
  EXPECT_LT((read.source_point - Vector3d(1000, 0, 0)).norm(), 1e-9);
  EXPECT_LT((read.beam_direction() - Vector3d(-1, 0, 0)).norm(), 1e-12);
  EXPECT_EQ(read.size_px, Eigen::Vector2i(1024, 768));
  EXPECT_FALSE(read.is_mirrored());
  // R (10, 20, 30) + t = (20, -30, 990).
  expect_seen(read, {10, 20, 30}, {511.5 + 5000.0 * 20 / 990, 383.5 - 5000.0 * 30 / 990});
}

TEST_F(CameraConventions, MayaCam2WithOtherLineEndsIsTheSame) {
  std::string text = kMayaCam2;
  for (std::size_t at = 0; (at = text.find('\n', at)) != std::string::npos; at += 2)
    text.replace(at, 1, "\r\n");
  EXPECT_EQ(camera(text).source_point, camera(kMayaCam2).source_point);
}

TEST_F(CameraConventions, MayaCam2Refusals) {
  const std::string good = kMayaCam2;
  EXPECT_THAT(file_refusal(test::replaced(good, "rotation\n", "turn\n")),
              HasSubstr("'rotation' is missing"));
  EXPECT_THAT(file_refusal(good.substr(0, good.size() - 5)), HasSubstr("truncated: 'translation'"));
  EXPECT_THAT(file_refusal(test::replaced(good, "5000,0,511.5", "5000,0")),
              HasSubstr("camera.txt:5: expected 3 numbers"));
  EXPECT_THAT(file_refusal(test::replaced(good, "0,1,0", "0,one,0")),
              HasSubstr("'one' is no number"));
  EXPECT_THAT(input_refusal(test::replaced(good, "1000\n", "nan\n")), HasSubstr("finite"));
  EXPECT_THAT(input_refusal(test::replaced(good, "1024,768", "1e18,768")), HasSubstr("32768"));
  EXPECT_THAT(input_refusal(test::replaced(good, "-1,0,0", "1,0,0")), HasSubstr("rotation"));
  EXPECT_THAT(input_refusal(test::replaced(good, "1000\n", "1e9\n")), HasSubstr("1e6 mm"));
  EXPECT_THAT(input_refusal(good + "skew\n0\n"),
              HasSubstr("camera.txt:18: line = 'skew': is not known"));
  EXPECT_THAT(input_refusal(good + "rotation\n1,0,0\n"), HasSubstr("camera.txt:18"));
}

// The source is at (0, -1000, 0). Turned by 90 deg about x, the camera's z axis, behind it, points
// to -y and its y axis up, to +z. The point is 1020 mm in front of it, 10 to the right, 30 up.
constexpr const char* kMayaCam1 = "0,-1000,0\n90,0,0\n0,0,-400\n513,301,-4000\n0.1,1024,768\n";

TEST_F(CameraConventions, MayaCam1) {
  const CameraGeometry read = camera(kMayaCam1);
  EXPECT_LT((read.source_point - Vector3d(0, -1000, 0)).norm(), 1e-9);
  EXPECT_LT((read.beam_direction() - Vector3d(0, 1, 0)).norm(), 1e-12);
  expect_seen(read, {10, 20, 30}, {512 + 4000.0 * 10 / 1020, 767 - (300 + 4000.0 * 30 / 1020)});
}

TEST_F(CameraConventions, MayaCam1TurnsAboutZThenYThenX) {
  const CameraGeometry read = camera("0,0,900\n0,0,90\n0,0,-1\n513,385,-4000\n1,1024,768\n");
  // Turned by 90 deg about z, columns run along +y and rows, downwards, along +x.
  EXPECT_LT((read.column_direction - Vector3d(0, 1, 0)).norm(), 1e-12);
  EXPECT_LT((read.row_direction - Vector3d(1, 0, 0)).norm(), 1e-12);
  const CameraGeometry oblique = camera("0,0,900\n10,20,90\n0,0,-1\n513,385,4000\n1,0,0\n");
  // x axis of Rz(90) Ry(20) Rx(10): (0, cos 20, -sin 20).
  const double angle = 20.0 * std::acos(-1.0) / 180.0;
  EXPECT_LT((oblique.column_direction - Vector3d(0, std::cos(angle), -std::sin(angle))).norm(),
            1e-12);
  EXPECT_EQ(oblique.size_px, Eigen::Vector2i(1024, 1024));
}

TEST_F(CameraConventions, AByteOrderMarkIsNoPartOfTheText) {
  const std::string mark = "\xEF\xBB\xBF";
  EXPECT_EQ(camera(mark + kMayaCam2).source_point, camera(kMayaCam2).source_point);
  EXPECT_EQ(camera(mark + kMayaCam1).source_point, camera(kMayaCam1).source_point);
}

TEST_F(CameraConventions, MayaCam1Refusals) {
  const std::string good = kMayaCam1;
  EXPECT_THAT(file_refusal(test::replaced(good, "513,301,-4000\n", "")), HasSubstr("known format"));
  EXPECT_THAT(input_refusal(test::replaced(good, "90,0,0", "nan,0,0")), HasSubstr("finite"));
  EXPECT_THAT(input_refusal(test::replaced(good, "1024,768", "1e300,768")), HasSubstr("32768"));
  EXPECT_THAT(input_refusal(test::replaced(good, "-4000", "0")), HasSubstr("focal lengths"));
}

// Written by OpenCV 4.6 (cv2.FileStorage), pixels by cv2.projectPoints:
// K = [[1200, 0, 255.5], [0, 1100, 200.25], [0, 0, 1]], rvec = (0.3, -0.2, 0.5), t = (10, -20,
// 900).
constexpr const char* kOpenCv = R"(%YAML:1.0
---
image_width: 512
image_height: 400
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 1200., 0., 2.5550000000000000e+02, 0., 1100.,
       2.0025000000000000e+02, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ 0., 0., 0., 0., 0. ]
rvec: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ 2.9999999999999999e-01, -2.0000000000000001e-01,
       5.0000000000000000e-01 ]
tvec: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ 10., -20., 900. ]
)";

constexpr const char* kOpenCvRotation = R"(R: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 8.5953389855866325e-01, -4.9799153700292198e-01,
       -1.1491695393636675e-01, 4.3986763295823095e-01,
       8.3531560520670856e-01, -3.2979433769225508e-01,
       2.6022671404809444e-01, 2.3292116428443663e-01,
       9.3703243728491803e-01 ]
)";

void expect_opencv_pixels(const CameraGeometry& camera) {
  EXPECT_LT((camera.project({0, 0, 0}) - Vector2d(268.8333333333333, 175.80555555555554)).norm(),
            kConventionPx);
  EXPECT_LT(
      (camera.project({30, -40, 55}) - Vector2d(317.8796075813862, 132.68262579521775)).norm(),
      kConventionPx);
  EXPECT_LT(
      (camera.project({-25, 60, -70}) - Vector2d(208.00093808321148, 255.39893002595946)).norm(),
      kConventionPx);
}

TEST_F(CameraConventions, OpenCv) {
  const CameraGeometry by_vector = camera(kOpenCv);
  expect_opencv_pixels(by_vector);
  EXPECT_EQ(by_vector.size_px, Eigen::Vector2i(512, 400));
  std::string text = kOpenCv;
  text.replace(text.find("rvec:"), text.find("tvec:") - text.find("rvec:"), kOpenCvRotation);
  expect_opencv_pixels(camera(text));
}

TEST_F(CameraConventions, OpenCvSeveralCamerasAndPlainYaml) {
  const CameraRig rig = read(R"(image_size: [640, 480]
M1:
  rows: 3
  cols: 3
  data: [1000, 0, 319.5, 0, 1000, 239.5, 0, 0, 1]
R1: [1, 0, 0, 0, 1, 0, 0, 0, 1]
T1: [0, 0, 500]
M2:
  rows: 3
  cols: 3
  data: [1000, 0, 319.5, 0, 1000, 239.5, 0, 0, 1]
R2: [0, 0, -1, 0, 1, 0, 1, 0, 0]
T2: [0, 0, 600]
)");
  ASSERT_EQ(rig.cameras.size(), 2U);
  expect_seen(rig.cameras[0], {10, 20, 0}, {319.5 + 1000.0 * 10 / 500, 239.5 + 1000.0 * 20 / 500});
  expect_seen(rig.cameras[1], {0, 20, 30}, {319.5 - 1000.0 * 30 / 600, 239.5 + 1000.0 * 20 / 600});
}

// The same numbers as lists with dashes, as YAML libraries of other languages write them: of
// numbers, of rows in brackets, of lists of lists, indented or not, as `data` of a matrix.
TEST_F(CameraConventions, OpenCvBlockLists) {
  const std::string size = "image_size:\n- 512\n- 400\n";
  const std::string pose = "rvec:\n  - 0.3\n  - -0.2\n  - 0.5\ntvec:\n- [10]\n- [-20]\n- [900]\n";
  const std::string lens =
      "dist:  # k1, k2, p1, p2, k3\n  - -0.35\n  - 0.12   # k2\n  - 4e-3\n"
      "  -  -0.003\n  # nothing\n  - 0.05\n";
  const std::vector<std::string> matrices = {
      "K:\n- - 1200\n  - 0\n  - 255.5\n- - 0\n  - 1100\n  - 200.25\n-\n  - 0\n  - 0\n  - 1\n",
      "K:\n  - [1200, 0, 255.5]\n  - [0, 1100,\n     200.25]\n  - [0, 0, 1]\n",
      "K: [[1200, 0, 255.5],  # columns\n    [0, 1100, 200.25],\n    [0, 0, 1]]\n",
      "K:\n   rows: 3\n   cols: 3\n   data:\n   - 1200\n   - 0\n   - 255.5\n   - 0\n   - 1100\n"
      "   - 200.25\n   - 0\n   - 0\n   - 1\n"};
  for (const std::string& matrix : matrices) {
    const CameraGeometry read = camera(size + matrix + lens + pose);
    expect_opencv_pixels(read);
    EXPECT_EQ(read.size_px, Eigen::Vector2i(512, 400));
    const Vector2d stored =
        PixelDistortion(read).stored_from_ideal(read.project(Vector3d(30, -40, 55)));
    EXPECT_LT((stored - Vector2d(317.6651288, 132.91818315)).norm(), 1e-5) << matrix;
  }
  const std::string good = size + matrices[0] + lens + pose;
  EXPECT_THAT(file_refusal(test::replaced(good, "  - 0.05\n", "  - 0.05\n  - 1\n")),
              HasSubstr("4, 5, 8, 12 or 14 numbers"));
  EXPECT_THAT(file_refusal(test::replaced(good, "  - 4e-3\n", "  - four\n")),
              HasSubstr("is no number"));
  EXPECT_THAT(file_refusal(test::replaced(good, "- [900]\n", "- [900\n")),
              HasSubstr("truncated: a list"));
}

TEST_F(CameraConventions, OpenCvRefusals) {
  const std::string good = kOpenCv;
  const std::size_t pose = good.find("rvec:");
  EXPECT_THAT(input_refusal(good.substr(0, pose)), HasSubstr("x_camera = R x_room + t"));
  EXPECT_THAT(file_refusal(good.substr(0, good.find("2.0025"))), HasSubstr("truncated: a list"));
  EXPECT_THAT(file_refusal(test::replaced(good, "   rows: 3\n", "   rows: 99999999999999\n")),
              HasSubstr("'rows'"));
  EXPECT_THAT(file_refusal(test::replaced(good, "   cols: 3\n", "   cols: 4\n")),
              HasSubstr("12 numbers"));
  EXPECT_THAT(input_refusal(test::replaced(good, "900.", "nan")), HasSubstr("finite"));
  EXPECT_THAT(input_refusal(test::replaced(good, "image_width: 512", "image_width: 5e9")),
              HasSubstr("32768"));
  EXPECT_THAT(input_refusal(test::replaced(good, "[ 0., 0., 0.", "[ -9.1, 0., 0.")),
              HasSubstr("must not fold the image"));
  EXPECT_THAT(
      file_refusal(test::replaced(
          test::replaced(good, "rows: 5", "rows: 3"), "[ 0., 0., 0., 0., 0. ]", "[ 0.1, 0., 0. ]")),
      HasSubstr("4, 5, 8, 12 or 14 numbers"));
  EXPECT_THAT(input_refusal(test::replaced(test::replaced(good, "rows: 5", "rows: 12"),
                                           "[ 0., 0., 0., 0., 0. ]",
                                           "[ 0, 0, 0, 0, 0, 0, 0, 0, 0.1, 0, 0, 0 ]")),
              HasSubstr("thin prisms"));
  // A stereo calibration's R and t are of the second camera relative to the first.
  const std::string stereo =
      "K1: [1000, 0, 320, 0, 1000, 240, 0, 0, 1]\nK2: [1000, 0, 320, 0, 1000, 240, 0, 0, 1]\n"
      "R: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nt: [0, 0, 500]\n";
  EXPECT_THAT(input_refusal(stereo), HasSubstr("relative to the first camera"));
  EXPECT_THAT(input_refusal(good + "distortion_model: equidistant\n"),
              HasSubstr("distortion_model = 'equidistant'"));
  EXPECT_THAT(file_refusal(good + "distortion_model equidistant\n"), HasSubstr("camera.txt:27"));
}

TEST_F(CameraConventions, WhatIsNotReadOfFilesThatHoldMoreThanCamerasIsNamed) {
  (void)read(std::string(kOpenCv) + "reprojection_error: 0.3\n");
  EXPECT_THAT(warnings(), testing::Contains(HasSubstr("not read: reprojection_error")));
  (void)read(
      "K1: [1000, 0, 320, 0, 1000, 240, 0, 0, 1]\nR1: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n"
      "t1: [0, 0, 500]\nK2: [1000, 0, 320, 0, 1000, 240, 0, 0, 1]\n"
      "R2: [0, 0, -1, 0, 1, 0, 1, 0, 0]\nt2: [0, 0, 600]\nT: [1, 0, 0]\n"
      "image_size: [640, 480]\n");
  EXPECT_THAT(warnings(), testing::Contains(HasSubstr("not read: T")));
}

TEST_F(CameraConventions, TheOnlyCameraMayHaveANumber) {
  const std::string one =
      "K1: [1000, 0, 320, 0, 1000, 240, 0, 0, 1]\nimage_width: 640\nimage_height: 480\n"
      "pixel_spacing_mm: [0.5, 0.5]\nisocenter_point: [0, 0, 0]\n"
      "R: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nt: [0, 0, 500]\n";
  expect_seen(camera(one), {10, 20, 0}, {320 + 1000 * 10 / 500.0, 240 + 1000 * 20 / 500.0});
}

TEST_F(CameraConventions, NamesAreUtf8) {
  const std::string good = kOpenCv;
  EXPECT_EQ(camera("camera_name: \"\xc3\xa4\"\n" + good).name, "\xc3\xa4");
  EXPECT_THAT(input_refusal("camera_name: \"\xc3\"\n" + good), HasSubstr("must be UTF-8"));
}

// cv2.projectPoints of OpenCV 4.6 with these coefficients puts (30, -40, 55) at (317.66513,
// 132.91818), at (317.87961, 132.68263) without.
TEST_F(CameraConventions, OpenCvDistortion) {
  const CameraGeometry read = camera(
      test::replaced(kOpenCv, "[ 0., 0., 0., 0., 0. ]", "[ -0.35, 0.12, 0.004, -0.003, 0.05 ]"));
  expect_opencv_pixels(read);
  const Vector2d stored =
      PixelDistortion(read).stored_from_ideal(read.project(Vector3d(30, -40, 55)));
  EXPECT_LT((stored - Vector2d(317.6651288, 132.91818315)).norm(), 1e-5) << stored.transpose();
}

TEST_F(CameraConventions, FlippedRowsTurnTheLensRound) {
  const std::string text =
      test::replaced(kOpenCv, "[ 0., 0., 0., 0., 0. ]", "[ -0.35, 0.12, 0.004, -0.003, 0.05 ]");
  const CameraGeometry as_is = camera(text);
  CameraFileOptions options;
  for (const char* flip : {"rows", "columns"}) {
    options.flip = flip;
    const CameraGeometry flipped = camera(text, options);
    const bool flips_rows = std::string(flip) == "rows";
    const auto mirror = [&](const Vector2d& px) {
      return flips_rows ? Vector2d(px.x(), 399 - px.y()) : Vector2d(511 - px.x(), px.y());
    };
    const Vector2d stored = PixelDistortion(as_is).stored_from_ideal({100, 50});
    const Vector2d stored_flipped = PixelDistortion(flipped).stored_from_ideal(mirror({100, 50}));
    EXPECT_LT((stored_flipped - mirror(stored)).norm(), kConventionPx) << flip;
  }
}

CameraFileOptions matrix_options() {
  CameraFileOptions options;
  options.size_px = {512, 400};
  options.isocenter_point = {0, 0, 0};
  return options;
}

TEST_F(CameraConventions, MatrixText) {
  // K (R | t) with K of focal length 1000 and (255.5, 199.5), R = (e_x, -e_z, e_y), t = (0, 0,
  // 800).
  const std::string text =
      "# source at (0, -800, 0)\n1000 255.5 0 204400\n0 199.5 -1000 159600\n0 1 0 800\n";
  for (const std::string& matrix :
       {text,
        std::string("-1000 -255.5 0 -204400\n0 -199.5 1000 -159600\n0 -1 0 -800\n"),
        std::string("[[2000, 511, 0, 408800],\n[0, 399, -2000, 319200],\n[0, 2, 0, 1600]]"),
        std::string("1000,255.5,0,204400,0,199.5,-1000,159600,0,1,0,800\n")}) {
    const CameraGeometry read = camera(matrix, matrix_options());
    EXPECT_LT((read.source_point - Vector3d(0, -800, 0)).norm(), 1e-9);
    expect_seen(read, {10, 20, 30}, {255.5 + 1000.0 * 10 / 820, 199.5 - 1000.0 * 30 / 820});
    EXPECT_FALSE(read.is_mirrored());
  }
}

TEST_F(CameraConventions, MatrixTextRefusals) {
  const std::string good = "1000 255.5 0 204400\n0 199.5 -1000 159600\n0 1 0 800\n";
  const auto refusal = [&](const std::string& text) {
    return test::message_of<Error>([&] { (void)read(text, matrix_options()); });
  };
  EXPECT_THAT(input_refusal(good), HasSubstr("--rig-size-px"));
  EXPECT_THAT(refusal(good.substr(0, 40)), HasSubstr("known format"));
  EXPECT_THAT(refusal(test::replaced(good, "800\n", "nan\n")), HasSubstr("finite"));
  EXPECT_THAT(refusal("0 0 0 1\n0 0 0 1\n0 0 0 1\n"), HasSubstr("singular"));
  EXPECT_THAT(refusal(test::replaced(good, "1000 255.5 0", "1000 255.5 700")), HasSubstr("skew"));
  EXPECT_THAT(refusal("# size_px 1e30 4\n" + good), HasSubstr("32768"));
}

constexpr const char* kRtk = R"(<?xml version="1.0"?>
<!DOCTYPE RTKGEOMETRY>
<RTKThreeDCircularGeometry version="3">
  <SourceToIsocenterDistance>1000</SourceToIsocenterDistance>
  <SourceToDetectorDistance>1536</SourceToDetectorDistance>
  <Projection>
    <GantryAngle>90</GantryAngle>
  </Projection>
  <Projection>
    <GantryAngle>30</GantryAngle>
    <OutOfPlaneAngle>5</OutOfPlaneAngle>
    <InPlaneAngle>-3</InPlaneAngle>
    <SourceOffsetX>2</SourceOffsetX>
    <SourceOffsetY>-4</SourceOffsetY>
    <ProjectionOffsetX>-117</ProjectionOffsetX>
    <ProjectionOffsetY>6</ProjectionOffsetY>
  </Projection>
</RTKThreeDCircularGeometry>
)";

CameraFileOptions rtk_options() {
  CameraFileOptions options;
  options.size_px = {512, 400};
  options.pixel_spacing_mm = {0.8, 0.8};
  return options;
}

Eigen::Matrix3d turn_about(int axis, double deg) {
  const double angle = deg * std::acos(-1.0) / 180.0;
  const int a = (axis + 1) % 3;
  const int b = (axis + 2) % 3;
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();
  matrix(a, a) = matrix(b, b) = std::cos(angle);
  matrix(a, b) = -std::sin(angle);
  matrix(b, a) = std::sin(angle);
  return matrix;
}

TEST_F(CameraConventions, Rtk) {
  const CameraRig rig = read(kRtk, rtk_options());
  ASSERT_EQ(rig.cameras.size(), 2U);
  EXPECT_EQ(rig.isocenter_point, Vector3d(0, 0, 0));
  // Gantry angle 90: the source has turned from +z to +x, u runs along -z, v along +y.
  const CameraGeometry& first = rig.cameras[0];
  EXPECT_LT((first.source_point - Vector3d(1000, 0, 0)).norm(), 1e-9);
  EXPECT_TRUE(first.is_mirrored());
  const double scale = 1536.0 / (1000 - 10) / 0.8;
  expect_seen(first, {10, 20, 30}, {255.5 - 30 * scale, 199.5 + 20 * scale});

  // RTK's own product of matrices, of its documentation: MTransl2D M(SDD, SID) MTransl3D MR.
  Eigen::Matrix3d shift_uv = Eigen::Matrix3d::Identity();
  shift_uv.col(2) = Vector3d(2.0 + 117.0, -4.0 - 6.0, 1.0);
  Eigen::Matrix<double, 3, 4> magnification = Eigen::Matrix<double, 3, 4>::Zero();
  magnification(0, 0) = magnification(1, 1) = -1536.0;
  magnification(2, 2) = 1.0;
  magnification(2, 3) = -1000.0;
  Eigen::Matrix4d shift_source = Eigen::Matrix4d::Identity();
  shift_source.topRightCorner<2, 1>() = Vector2d(-2.0, 4.0);
  Eigen::Matrix4d turn = Eigen::Matrix4d::Identity();
  turn.topLeftCorner<3, 3>() = turn_about(2, 3) * turn_about(0, -5) * turn_about(1, -30);
  const Vector3d uv =
      shift_uv * magnification * shift_source * turn * Vector3d(10, 20, 30).homogeneous();
  expect_seen(
      rig.cameras[1], {10, 20, 30}, {255.5 + uv.x() / uv.z() / 0.8, 199.5 + uv.y() / uv.z() / 0.8});
}

/// A beam along y: gantry and in-plane angle turn about one axis.
TEST_F(CameraConventions, RtkWritesCamerasThatLookAlongTheGantrysAxis) {
  for (const double side : {1.0, -1.0})
    for (const double turn_rad : {0.0, 0.3, 3.1, -2.0}) {
      const Eigen::AngleAxisd turn(turn_rad, Vector3d::UnitY());
      CameraGeometry written;
      written.name = "AP";
      written.size_px = {64, 48};
      written.pixel_spacing_mm = {0.8, 0.8};
      written.source_point = Vector3d(0.0, -650.0 * side, 0.0);
      written.column_direction = turn * Vector3d(1.0, 0.0, 0.0);
      written.row_direction = turn * Vector3d(0.0, 0.0, side);
      written.detector_origin_point = Vector3d(0.0, 370.0 * side, 0.0) -
                                      25.2 * written.column_direction -
                                      18.8 * written.row_direction;
      CameraRig rig;
      rig.isocenter_point = Vector3d::Zero();
      rig.cameras = {written};
      CameraFileOptions options;
      options.size_px = {64, 48};
      options.pixel_spacing_mm = {0.8, 0.8};
      const CameraGeometry read = camera(write_rtk_geometry(rig), options);
      for (const Vector3d& point : {Vector3d(10, 20, 30), Vector3d(-40, 5, 12)})
        EXPECT_LT((read.project(point) - written.project(point)).norm(), 1e-6)
            << "side " << side << ", turned by " << turn_rad;
    }
}

TEST_F(CameraConventions, RtkOriginOfTheProjectionsAndTheirMatrix) {
  CameraFileOptions options = rtk_options();
  options.detector_origin_mm = {-100.0, -80.0};
  const double scale = 1536.0 / (1000 - 10);
  const CameraGeometry read = camera(kRtk, options);
  expect_seen(read, {10, 20, 30}, {(100 - 30 * scale) / 0.8, (80 + 20 * scale) / 0.8});

  // At angle 90, R takes x to z, so that w = x - SID, u = SDD z / w and v = -SDD y / w.
  const std::string with_matrix =
      test::replaced(kRtk,
                     "90</GantryAngle>\n",
                     "90</GantryAngle>\n<Matrix>\n0 0 1536 0\n0 -1536 0 0\n1 0 0 -1000</Matrix>\n");
  EXPECT_EQ(camera(with_matrix, options).source_point, read.source_point);
  EXPECT_THAT(test::message_of<InputError>([&] {
                (void)camera(test::replaced(with_matrix, "0 0 1536 0", "0 0 1536 50"), options);
              }),
              HasSubstr("does not agree"));
}

/// A file of RTK's: distances, and these projections.
std::string rtk_file(const std::string& projections, const std::string& version = "3") {
  return "<RTKThreeDCircularGeometry version=\"" + version +
         "\"><SourceToIsocenterDistance>742.46</SourceToIsocenterDistance>"
         "<SourceToDetectorDistance>1209.96</SourceToDetectorDistance>" +
         projections + "</RTKThreeDCircularGeometry>";
}

TEST_F(CameraConventions, RtkTakesNamesAndValuesAsRtkDoes) {
  const std::string angle = "<GantryAngle>119.4</GantryAngle>";
  const std::string tilted =
      "<Projection>" + angle + "<OutOfPlaneAngle>25</OutOfPlaneAngle></Projection>";
  const std::string moved = "<ProjectionOffsetX>30</ProjectionOffsetX>";
  const std::vector<std::array<std::string, 2>> same = {
      {"<Projection><Angle>119.4</Angle></Projection>", "<Projection>" + angle + "</Projection>"},
      {"<projection>" + angle + "<OutofPlaneAngle>25</OutofPlaneAngle></projection>", tilted},
      {"<Projection>" + moved + "</Projection><Projection>" + angle + "</Projection>",
       "<Projection>" + moved + "</Projection><Projection>" + angle + moved + "</Projection>"}};
  for (const auto& [as_written, as_meant] : same) {
    const CameraRig found = read(rtk_file(as_written), rtk_options());
    const CameraRig meant = read(rtk_file(as_meant, "2"), rtk_options());
    ASSERT_EQ(found.cameras.size(), meant.cameras.size());
    for (std::size_t i = 0; i < meant.cameras.size(); ++i) {
      EXPECT_EQ(found.cameras[i].source_point, meant.cameras[i].source_point) << as_written;
      EXPECT_EQ(found.cameras[i].project({10, 20, 30}), meant.cameras[i].project({10, 20, 30}));
    }
  }
}

TEST_F(CameraConventions, RtkRefusals) {
  const std::string projection = "<Projection></Projection>";
  for (const char* version : {"1", "4", ""})
    EXPECT_THAT(input_refusal(rtk_file(projection, version)), HasSubstr("version"));
  EXPECT_THAT(input_refusal(rtk_file("<Projection>\n<Tilt>3</Tilt></Projection>")),
              HasSubstr("camera.txt:2: element = <Tilt>"));
  EXPECT_THAT(input_refusal(rtk_file("<Scan>" + projection + "</Scan>")), HasSubstr("<Scan>"));
  const std::string good = kRtk;
  EXPECT_THAT(input_refusal(good), HasSubstr("--rig-size-px"));
  CameraFileOptions no_spacing;
  no_spacing.size_px = {512, 400};
  EXPECT_THAT(test::message_of<InputError>([&] { (void)read(good, no_spacing); }),
              HasSubstr("--rig-pixel-spacing-mm"));
  EXPECT_THAT(file_refusal(good.substr(0, good.size() - 40)), HasSubstr("broken XML"));
  EXPECT_THAT(file_refusal(test::replaced(good, ">90<", ">ninety<")), HasSubstr("GantryAngle"));
  EXPECT_THAT(input_refusal(test::replaced(good, ">90<", ">nan<")), HasSubstr("finite"));
  EXPECT_THAT(input_refusal(test::replaced(good, ">1536<", ">0<")), HasSubstr("parallel"));
  EXPECT_THAT(file_refusal(rtk_file("")), HasSubstr("no <Projection>"));
  std::string nested = "<RTKThreeDCircularGeometry>";
  for (int i = 0; i < 100; ++i) nested += "<a>";
  EXPECT_THAT(file_refusal(nested), HasSubstr("nested too deeply"));
  EXPECT_THAT(
      file_refusal(test::replaced(good, "RTKGEOMETRY>", "RTKGEOMETRY [<!ENTITY a \"aaaa\">]>")),
      HasSubstr("entities"));
}

// Written by plastimatch 1.9.4: plastimatch drr -G --nrm "0.6 -0.7 0.2" --vup "0.1 0.2 1" --sad 800
// --sid 1200 -r "240 200" -z "480 420" -c "110.5 95.25" -o "5 -7 11" -t pfm -O out_ ct.mha
constexpr const char* kPlastimatch = R"(    1.10500000e+02     9.52500000e+01
    3.85730695e-01     3.02329480e-01    -9.90389669e-02     1.27708152e+00
   -8.94575491e-03    -1.37869908e-01    -4.55707397e-01     4.09242078e+00
   -5.29998957e-04     6.18332082e-04    -1.76666315e-04     6.75588315e-01
    8.00000000e+02
    1.20000000e+03
   -6.35998749e-01     7.41998498e-01    -2.11999578e-01
Extrinsic
    7.71461389e-01     6.04658960e-01    -1.98077934e-01     2.55416304e+00
   -1.87860853e-02    -2.89526807e-01    -9.56985533e-01     8.59408365e+00
   -6.35998749e-01     7.41998498e-01    -2.11999578e-01     8.10705979e+02
    0.00000000e+00     0.00000000e+00     0.00000000e+00     1.00000000e+00
Intrinsic
    5.00000000e-01     0.00000000e+00     0.00000000e+00     0.00000000e+00
    0.00000000e+00     4.76190476e-01     0.00000000e+00     0.00000000e+00
    0.00000000e+00     0.00000000e+00     8.33333333e-04     0.00000000e+00
)";

constexpr const char* kPlastimatchCommand =
    "#!/bin/sh\nplastimatch drr --nrm \"0.6 -0.7 0.2\" --vup='0.1 0.2 1' --sad 800 --sid 1200 \\\n"
    "  -r \"240 200\" -z \"480 420\" -c \"110.5 95.25\" -o \"5 -7 11\" -t pfm -O out_ ct.mha\n";

// The file's numbers have 9 digits; 1e-9 of 1e3 mm and of 1e2 px, magnified by about 1.
constexpr double kNineDigitsPx = 1e-5;

TEST_F(CameraConventions, Plastimatch) {
  CameraFileOptions options;
  options.size_px = {240, 200};
  const CameraRig by_file = read(kPlastimatch, options);
  const CameraRig by_command = read(kPlastimatchCommand);
  // The matrix of the file: w = 0.61506..., at the image centre plus (P x) / w; plastimatch draws a
  // ball of 12 mm there, at (103.000, 70.070) by its centre of mass.
  const Vector2d expected(102.99675021, 70.09949423);
  for (const CameraRig& rig : {by_file, by_command}) {
    const CameraGeometry& camera = rig.cameras.front();
    EXPECT_LT((camera.project({30, -40, 55}) - expected).norm(), kNineDigitsPx);
    EXPECT_LT((rig.isocenter_point - Vector3d(5, -7, 11)).norm(), 1e-5);
    EXPECT_NEAR(camera.source_detector_distance_mm(), 1200.0, 1e-5);
    EXPECT_NEAR(camera.pixel_spacing_mm.x(), 2.0, 1e-8);
    EXPECT_NEAR(camera.pixel_spacing_mm.y(), 2.1, 1e-8);
    EXPECT_EQ(camera.size_px, Eigen::Vector2i(240, 200));
    EXPECT_FALSE(camera.is_mirrored());
  }
}

TEST_F(CameraConventions, PlastimatchRefusals) {
  const std::string good = kPlastimatch;
  EXPECT_THAT(input_refusal(good), HasSubstr("--rig-size-px"));
  EXPECT_THAT(file_refusal(good.substr(0, good.size() - 90)), HasSubstr("truncated"));
  EXPECT_THAT(input_refusal(test::replaced(good, "1.27708152e+00", "1.37708152e+00")),
              HasSubstr("Intrinsic times Extrinsic"));
  EXPECT_THAT(input_refusal(test::replaced(good, "8.00000000e+02", "inf")), HasSubstr("finite"));
  EXPECT_THAT(input_refusal(test::replaced(good, "8.00000000e+02", "-8e+02")), HasSubstr("SAD"));
  const std::string command = kPlastimatchCommand;
  EXPECT_THAT(input_refusal(test::replaced(command, "--nrm \"0.6 -0.7 0.2\"", "")),
              HasSubstr("--nrm"));
  EXPECT_THAT(input_refusal(test::replaced(command, "--sad", "--tilt")), HasSubstr("--tilt"));
  EXPECT_THAT(input_refusal(good + "Tilt 3\n"), HasSubstr("camera.txt:17: line = 'Tilt 3'"));
  EXPECT_THAT(input_refusal(test::replaced(command, "-o ", "-y ")), HasSubstr("--gantry-angle"));
  EXPECT_THAT(input_refusal(test::replaced(command, "0.1 0.2 1'", "0.6 -0.7 0.2'")),
              HasSubstr("parallel"));
  EXPECT_THAT(file_refusal(test::replaced(command, "--sad 800", "--sad far")),
              HasSubstr("no number"));
  EXPECT_THAT(input_refusal(test::replaced(command, "240 200", "1e12 200")), HasSubstr("32768"));
  EXPECT_THAT(input_refusal(command + "\n" + command), HasSubstr("2 plastimatch drr commands"));
  EXPECT_EQ(camera(command + "\nplastimatch convert --input a -o b.mha\n").source_point,
            camera(command).source_point);
}

// What elastix 5.0.1 writes as TransformParameters.0.txt, without the lines that say nothing of the
// camera. Its ray caster draws a ball at (30, -40, 55) there.
constexpr const char* kElastix = R"((Transform "EulerTransform")
(TransformParameters 0 0 0 0 0 0)
// a comment
(Size 240 200 1)
(Index 0 0 0)
(Spacing 2.0000000000 2.1000000000 1.0000000000)
(Origin -200.0000000000 300.0000000000 180.0000000000)
(Direction 1.0 0.0 0.0 0.0 0.0 -1.0 0.0 1.0 0.0)
(ResampleInterpolator "FinalRayCastInterpolator")
(FocalPoint 5.0 -800.0 11.0)
(PreParameters 0.0 0.0 0.0 0.0 0.0 0.0)
)";

TEST_F(CameraConventions, Elastix) {
  const CameraGeometry read = camera(kElastix);
  EXPECT_EQ(read.source_point, Vector3d(5, -800, 11));
  EXPECT_EQ(read.size_px, Eigen::Vector2i(240, 200));
  // From the focal point the ball is 760 of 1100 mm away along y.
  const double scale = 1100.0 / 760.0;
  expect_seen(read, {30, -40, 55}, {(200 + 5 + 25 * scale) / 2.0, (180 - (11 + 44 * scale)) / 2.1});
}

TEST_F(CameraConventions, ElastixRefusals) {
  const std::string good = kElastix;
  EXPECT_THAT(file_refusal(good.substr(0, good.find("11.0)") + 2)), HasSubstr("not closed"));
  EXPECT_THAT(input_refusal(test::replaced(good, "(Origin", "(Orient")), HasSubstr("(Origin ...)"));
  EXPECT_THAT(file_refusal(test::replaced(good, "-800.0 11.0", "-800.0")), HasSubstr("3 numbers"));
  EXPECT_THAT(input_refusal(test::replaced(good, "-800.0 11.0", "nan 11.0")), HasSubstr("finite"));
  EXPECT_THAT(input_refusal(test::replaced(good, "200 1)", "200 2)")), HasSubstr("single slice"));
  EXPECT_THAT(input_refusal(test::replaced(good, "240 200", "4e9 200")), HasSubstr("32768"));
  EXPECT_THAT(input_refusal(test::replaced(good, "(PreParameters 0.0", "(PreParameters 0.1")),
              HasSubstr("PreParameters"));
  EXPECT_THAT(input_refusal(test::replaced(good, "(Direction 1.0", "(Direction 2.0")),
              HasSubstr("column_direction"));
  EXPECT_THAT(input_refusal(good + "(UseDirectionCosines \"false\")\n"),
              HasSubstr("UseDirectionCosines"));
  EXPECT_THAT(input_refusal(good + "(FocalPoint 5.0 -900.0 11.0)\n"), HasSubstr("there twice"));
  EXPECT_THAT(file_refusal(good + "Tilt 3\n"), HasSubstr("camera.txt:12: 'Tilt 3'"));
  (void)read(test::replaced(good, "(TransformParameters 0", "(TransformParameters 0.1") +
             "(Tilt 3)\n");
  EXPECT_THAT(warnings(), testing::Contains(HasSubstr("not read: Tilt")));
  EXPECT_THAT(warnings(), testing::Contains(HasSubstr("TransformParameters are a pose")));
}

/// A camera as xReg states it: 1536 x 1200 pixels of 0.2 mm, 1000 mm from the source.
struct XRegExample {
  double focal_px = -5000.0;
  Vector3d translation = {5.0, -8.0, -700.0};
  const char* frame = nullptr;
  double row_spacing_mm = 0.2;

  void write(Hdf5Output& file, const std::string& group, const std::string& prefix) const {
    Eigen::Matrix3d intrinsic;
    intrinsic << focal_px, 0, 767.5, 0, focal_px, 599.5, 0, 0, 1;
    Eigen::Matrix4d extrinsic = Eigen::Matrix4d::Identity();
    extrinsic.topLeftCorner<3, 3>() << 0, 1, 0, 0, 0, 1, 1, 0, 0;
    extrinsic.topRightCorner<3, 1>() = translation;
    file.add_matrix(group + "/intrinsic", intrinsic);
    file.add_matrix(group + "/extrinsic", extrinsic);
    file.add_count(group + "/num-cols", 1536);
    file.add_count(group + "/num-rows", 1200);
    file.add_scalar(group + "/" + prefix + "col-spacing", 0.2);
    file.add_scalar(group + "/" + prefix + "row-spacing", row_spacing_mm);
    if (frame != nullptr) file.add_fixed_text(group + "/cam-coord-frame-type", frame);
  }

  /// As the data set DeepFluoro has it.
  [[nodiscard]] std::string deep_fluoro() const {
    Hdf5Output file;
    file.add_group("/proj-params");
    write(file, "/proj-params", "pixel-");
    return file.bytes();
  }

  /// As xReg writes one camera.
  [[nodiscard]] std::string camera() const {
    Hdf5Output file;
    write(file, "", "");
    return file.bytes();
  }
};

TEST_F(CameraConventions, XRegDeepFluoro) {
  const CameraGeometry read = camera(XRegExample().deep_fluoro());
  // -R' t.
  EXPECT_LT((read.source_point - Vector3d(700, -5, 8)).norm(), 1e-9);
  EXPECT_NEAR(read.source_detector_distance_mm(), 1000.0, 1e-9);
  EXPECT_EQ(read.size_px, Eigen::Vector2i(1536, 1200));
  EXPECT_TRUE(read.is_mirrored()) << "columns x rows points to the source";
  // The extrinsic matrix takes (10, 20, 30) to (25, 22, -690).
  expect_seen(read, {10, 20, 30}, {767.5 + 5000.0 * 25 / 690, 599.5 + 5000.0 * 22 / 690});
}

TEST_F(CameraConventions, XRegFrames) {
  const Vector2d at_710(767.5 + 5000.0 * 25 / 710, 599.5 + 5000.0 * 22 / 710);
  const Vector2d at_690(767.5 + 5000.0 * 25 / 690, 599.5 + 5000.0 * 22 / 690);
  const XRegExample plus = {5000.0, {5, -8, 700}, "origin-at-focal-pt-det-pos-z"};
  EXPECT_FALSE(camera(plus.camera()).is_mirrored());
  expect_seen(camera(plus.camera()), {10, 20, 30}, at_710);
  const XRegExample minus = {-5000.0, {5, -8, -700}, "origin-at-focal-pt-det-neg-z"};
  expect_seen(camera(minus.camera()), {10, 20, 30}, at_690);
  // 310 mm of 1000 mm in front of the detector.
  const XRegExample on_detector = {5000.0, {5, -8, 300}, "origin-on-det"};
  const CameraGeometry read = camera(on_detector.camera());
  expect_seen(read, {10, 20, 30}, at_690);
  // 700 mm further along x, the third row of the extrinsic matrix.
  EXPECT_LT((read.source_point - Vector3d(700, -5, 8)).norm(), 1e-9);
}

TEST_F(CameraConventions, XRegSeveralProjections) {
  Hdf5Output file;
  file.add_count("/num-projs", 2);
  for (const char* group : {"/proj-000", "/proj-001"}) {
    file.add_group(group);
    file.add_group(std::string(group) + "/cam");
    XRegExample example = {5000.0, {5, -8, 700}, "origin-at-focal-pt-det-pos-z"};
    if (std::string(group) == "/proj-001") example.translation.z() = 800;
    example.write(file, std::string(group) + "/cam", "");
  }
  CameraFileOptions options;
  options.isocenter_point = {0.0, 0.0, 0.0};
  const CameraRig rig = read(file.bytes(), options);
  ASSERT_EQ(rig.cameras.size(), 2U);
  EXPECT_EQ(rig.cameras[1].name, "camera-2");
  expect_seen(rig.cameras[1], {10, 20, 30}, {767.5 + 5000.0 * 25 / 810, 599.5 + 5000.0 * 22 / 810});
}

TEST_F(CameraConventions, XRegNamesWhatOfACameraIsNotRead) {
  Hdf5Output file;
  file.add_group("/proj-params");
  XRegExample().write(file, "/proj-params", "pixel-");
  file.add_scalar("/proj-params/tilt", 3.0);
  (void)read(file.bytes());
  EXPECT_THAT(warnings(), testing::Contains(HasSubstr("/proj-params/tilt: not read")));
}

TEST_F(CameraConventions, XRegRefusals) {
  EXPECT_THAT(input_refusal(XRegExample({.row_spacing_mm = 0.3}).deep_fluoro()),
              HasSubstr("/proj-params/pixel-row-spacing = 0.3: must agree with the intrinsic"));
  EXPECT_THAT(input_refusal(XRegExample({.frame = "sideways"}).camera()),
              HasSubstr("/cam-coord-frame-type = 'sideways': must be one of"));
  EXPECT_THAT(input_refusal(XRegExample({.focal_px = 0.0}).deep_fluoro()),
              HasSubstr("focal lengths"));
  Hdf5Output empty;
  empty.add_group("/proj-params");
  EXPECT_THAT(file_refusal(empty.bytes()), HasSubstr("has no /proj-params/intrinsic"));
  Hdf5Output flat;
  flat.add_group("/proj-params");
  flat.add_numbers("/proj-params/intrinsic", std::vector<double>(9, 1.0));
  EXPECT_THAT(file_refusal(flat.bytes()), HasSubstr("is no matrix of 3 x 3"));
  Hdf5Output many;
  many.add_scalar("/num-projs", 1e300);
  EXPECT_THAT(input_refusal(many.bytes()), HasSubstr("between 1 and 10000"));
}

constexpr const char* kRad =
    "Size[pixels]: 512 400\nStep[mm]: 0.4 0.5\nDataType: float\nSourcePosition[mm]: -700 5 -8\n"
    "TPosition:\n0 0 -1 300\n1 0 0 -100\n0 -1 0 80\n0 0 0 1\n";

TEST_F(CameraConventions, Rad) {
  const CameraGeometry read = camera(kRad);
  EXPECT_EQ(read.size_px, Eigen::Vector2i(512, 400));
  EXPECT_TRUE(read.is_mirrored()) << "columns x rows points to the source";
  // 710 of the 1000 mm from the source to the detector.
  expect_seen(read,
              {10, 20, 30},
              {(100 + 5 + 15 * 1000.0 / 710) / 0.4, (80 + 8 - 38 * 1000.0 / 710) / 0.5});
}

TEST_F(CameraConventions, RadRefusals) {
  const std::string good = kRad;
  EXPECT_THAT(file_refusal(test::replaced(good, "Step[mm]: ", "Steps: ")),
              HasSubstr("'Step[mm]:' is missing"));
  EXPECT_THAT(file_refusal(good.substr(0, good.find("0 -1 0 80"))),
              HasSubstr("truncated: TPosition"));
  EXPECT_THAT(file_refusal(test::replaced(good, "-700 5 -8", "-700 5")),
              HasSubstr("camera.txt:4: expected 3 numbers"));
  EXPECT_THAT(input_refusal(test::replaced(good, "-700 5 -8", "700 5 -8")),
              HasSubstr("from the detector to the source"));
  EXPECT_THAT(input_refusal(test::replaced(good, "0 0 -1 300", "0 0 -2 300")),
              HasSubstr("TPosition"));
  EXPECT_THAT(file_refusal("Step[mm]: 1 1\n" + good), HasSubstr("'Step[mm]:' is there twice"));
  (void)read("Tilt[deg]: 3\n" + good);
  EXPECT_THAT(warnings(), testing::Contains(HasSubstr("not read: Tilt[deg]")));
}

constexpr const char* kDiffDrr =
    "[[diffdrr_camera]]\nsdd = 1020.0\nheight = 200\nwidth = 240\ndelx = 2.0\ndely = 1.5\n"
    "x0 = 12.0\ny0 = -9.0\nrotation = [0.0, 0.0, 0.0]\ntranslation = [0.0, 850.0, 0.0]\n";

TEST_F(CameraConventions, DiffDrr) {
  const CameraGeometry read = camera(kDiffDrr);
  // In front of the patient, the left of whom is on the right.
  EXPECT_LT((read.source_point - Vector3d(0, -850, 0)).norm(), 1e-9);
  EXPECT_LT((read.column_direction - Vector3d(1, 0, 0)).norm(), 1e-12);
  EXPECT_LT((read.row_direction - Vector3d(0, 0, -1)).norm(), 1e-12);
  EXPECT_FALSE(read.is_mirrored());
  const double magnification = 1020.0 / 870;
  expect_seen(read,
              {10, 20, 30},
              {119.5 + (12 + 10 * magnification) / 2, 99.5 + (-9 - 30 * magnification) / 1.5});
}

TEST_F(CameraConventions, DiffDrrCtFrameAndUnreversedColumns) {
  std::string text = "volume_middle_ct_mm = [5.0, -7.0, 11.0]\n" + std::string(kDiffDrr);
  const double magnification = 1020.0 / 870;
  expect_seen(camera(text),
              {15, 13, 41},
              {119.5 + (12 + 10 * magnification) / 2, 99.5 + (-9 - 30 * magnification) / 1.5});
  EXPECT_EQ(read(text).isocenter_point, Vector3d(5, -7, 11));
  text += "reverse_x_axis = false\n";
  EXPECT_TRUE(camera(text).is_mirrored());
  expect_seen(camera(text),
              {15, 13, 41},
              {119.5 - (12 + 10 * magnification) / 2, 99.5 + (-9 - 30 * magnification) / 1.5});
}

// DRR() and Detector() of DiffDRR 0.4, written out: a pixel's point is (x, y, sdd) in the camera's
// frame, turned to the orientation PA, moved by t and turned by Rx Ry Rz.
TEST_F(CameraConventions, DiffDrrTurnedPixels) {
  const std::string text =
      test::replaced(test::replaced(kDiffDrr, "[0.0, 0.0, 0.0]", "[0.3, -0.2, 0.1]"),
                     "[0.0, 850.0, 0.0]",
                     "[10.0, -800.0, 30.0]") +
      "convention = \"XYZ\"\norientation = \"PA\"\n";
  const CameraGeometry read = camera(text);
  const auto about = [](double angle, const Vector3d& axis) {
    return Eigen::AngleAxisd(angle, axis).toRotationMatrix();
  };
  const Eigen::Matrix3d turn = about(0.3, Vector3d::UnitX()) * about(-0.2, Vector3d::UnitY()) *
                               about(0.1, Vector3d::UnitZ());
  Eigen::Matrix3d pa;
  pa << -1, 0, 0, 0, 0, 1, 0, 1, 0;
  const auto lps = [&](const Vector3d& of_camera) -> Vector3d {
    return Vector3d(-1, -1, 1).cwiseProduct(turn * (pa * of_camera + Vector3d(10, -800, 30)));
  };
  EXPECT_LT((read.source_point - lps(Vector3d::Zero())).norm(), 1e-9)
      << read.source_point.transpose() << " instead of " << lps(Vector3d::Zero()).transpose();
  for (const Vector2d& pixel : {Vector2d(0, 0), Vector2d(239, 0), Vector2d(17, 199)})
    EXPECT_LT((read.detector_point(pixel.x(), pixel.y()) -
               lps({12 - 2.0 * (pixel.x() - 119.5), -9 - 1.5 * (pixel.y() - 99.5), 1020}))
                  .norm(),
              1e-9);
}

TEST_F(CameraConventions, DiffDrrRefusals) {
  const std::string good = kDiffDrr;
  EXPECT_THAT(input_refusal(test::replaced(good, "sdd = 1020.0\n", "")), HasSubstr("sdd"));
  EXPECT_THAT(input_refusal(test::replaced(good, "delx = 2.0", "delx = -2.0")),
              HasSubstr("must be above 0"));
  EXPECT_THAT(input_refusal(test::replaced(good, "height = 200", "height = 0")),
              HasSubstr("between 1 and 32768"));
  EXPECT_THAT(input_refusal(good + "convention = \"ZZX\"\n"), HasSubstr("neighbours different"));
  EXPECT_THAT(input_refusal(good + "parameterization = \"quaternion\"\n"), HasSubstr("rotation"));
  EXPECT_THAT(input_refusal(good + "sid = 3\n"), HasSubstr("sid"));
}

class DicomCameras : public testing::Test {
 protected:
  /// An XA image of 400 columns and 512 rows, 0.3 and 0.4 mm apart at the detector.
  static test::DicomTestFile xa() {
    test::DicomTestFile file;
    file.set_text({0x0008, 0x0060}, "CS", "XA");
    file.set_text({0x0018, 0x1110}, "DS", "1200");
    file.set_text({0x0018, 0x1111}, "DS", "800");
    file.set_text({0x0018, 0x1164}, "DS", "0.4\\0.3");
    file.set_text({0x0018, 0x1500}, "CS", "STATIC");
    file.set_text({0x0018, 0x1510}, "DS", "0");
    file.set_text({0x0018, 0x1511}, "DS", "0");
    file.set_text({0x0020, 0x0020}, "CS", "L\\F");
    file.set_u16({0x0028, 0x0010}, 512);
    file.set_u16({0x0028, 0x0011}, 400);
    return file;
  }
  CameraRig read(const test::DicomTestFile& file, const CameraFileOptions& options = {}) {
    file.write(folder_ / "image.dcm");
    warnings_.clear();
    return read_camera_files({folder_ / "image.dcm"}, options, &warnings_);
  }
  std::string refusal(const test::DicomTestFile& file, const CameraFileOptions& options = {}) {
    return test::message_of<InputError>([&] { (void)read(file, options); });
  }
  [[nodiscard]] const std::vector<std::string>& warnings() const { return warnings_; }
  [[nodiscard]] const test::ScratchFolder& folder() const { return folder_; }

 private:
  test::ScratchFolder folder_;
  std::vector<std::string> warnings_;
};

void expect_dicom_pixel(const CameraGeometry& camera, const Vector3d& point, const Vector2d& at) {
  EXPECT_LT((camera.project(point) - at).norm(), kConventionPx)
      << camera.project(point).transpose() << " instead of " << at.transpose();
}

TEST_F(DicomCameras, AtAnglesZeroThePatientFacesTheDetector) {
  const CameraGeometry camera = read(xa()).cameras.front();
  EXPECT_LT((camera.source_point - Vector3d(0, 800, 0)).norm(), 1e-9);  // behind the back
  EXPECT_LT((camera.beam_direction() - Vector3d(0, -1, 0)).norm(), 1e-12);
  EXPECT_TRUE(camera.is_mirrored());  // seen from the detector, against the beam
  const double scale = 1200.0 / (800 - 20);
  expect_dicom_pixel(camera, {10, 20, 30}, {199.5 + 10 * scale / 0.3, 255.5 - 30 * scale / 0.4});
  EXPECT_THAT(warnings(), testing::ElementsAre(HasSubstr("mirrored")));
}

TEST_F(DicomCameras, AnglesAreLongitudeAndLatitudeOfTheDetector) {
  test::DicomTestFile file = xa();
  file.set_text({0x0018, 0x1510}, "DS", "30");   // LAO
  file.set_text({0x0018, 0x1511}, "DS", "-20");  // caudal
  const CameraGeometry camera = read(file).cameras.front();
  const double a = 30.0 * std::acos(-1.0) / 180.0;
  const double b = -20.0 * std::acos(-1.0) / 180.0;
  const Vector3d to_detector(
      std::sin(a) * std::cos(b), -std::cos(a) * std::cos(b), std::sin(b));  // left, front, foot
  EXPECT_LT((camera.beam_direction() - to_detector).norm(), 1e-12);
  EXPECT_LT((camera.source_point + 800.0 * to_detector).norm(), 1e-9);
  // The isocentre is in the middle; columns stay in the axial plane of the primary angle.
  expect_dicom_pixel(camera, {0, 0, 0}, {199.5, 255.5});
  EXPECT_LT((camera.column_direction - Vector3d(std::cos(a), std::sin(a), 0.0)).norm(), 1e-12);
  EXPECT_LT(camera.row_direction.z(), 0.0);
}

TEST_F(DicomCameras, PatientOrientationTurnsTheImageAround) {
  test::DicomTestFile file = xa();
  file.set_text({0x0020, 0x0020}, "CS", "R\\F");
  const CameraGeometry camera = read(file).cameras.front();
  EXPECT_FALSE(camera.is_mirrored());
  const double scale = 1200.0 / (800 - 20);
  expect_dicom_pixel(camera, {10, 20, 30}, {199.5 - 10 * scale / 0.3, 255.5 - 30 * scale / 0.4});
  file.erase({0x0020, 0x0020});
  EXPECT_TRUE(read(file).cameras.front().is_mirrored());
  EXPECT_THAT(warnings(), testing::Contains(HasSubstr("PatientOrientation (0020,0020)")));
  CameraFileOptions flip;
  flip.flip = "columns";
  EXPECT_FALSE(read(file, flip).cameras.front().is_mirrored());
}

TEST_F(DicomCameras, AnglesOfTheDetectorAndTheTableAreSaidNotToCount) {
  test::DicomTestFile file = xa();
  file.set_text({0x0018, 0x1138}, "DS", "0");
  file.set_text({0x0018, 0x1530}, "DS", "5");
  (void)read(file);
  EXPECT_THAT(warnings(),
              testing::UnorderedElementsAre(HasSubstr("mirrored"),
                                            HasSubstr("DetectorPrimaryAngle (0018,1530) = 5")));
}

TEST_F(DicomCameras, MovingPositionersHaveACameraPerFrame) {
  test::DicomTestFile file = xa();
  file.set_text({0x0018, 0x1500}, "CS", "DYNAMIC");
  file.set_text({0x0028, 0x0008}, "IS", "3");
  file.set_text({0x0018, 0x1510}, "DS", "10");
  file.set_text({0x0018, 0x1520}, "DS", "40");         // per frame
  file.set_text({0x0018, 0x1521}, "DS", "0\\0.5\\2");  // from the first
  const CameraRig rig = read(file);
  ASSERT_EQ(rig.cameras.size(), 3U);
  const double a = 90.0 * std::acos(-1.0) / 180.0;
  const double b = 2.0 * std::acos(-1.0) / 180.0;
  EXPECT_LT((rig.cameras[2].beam_direction() -
             Vector3d(std::sin(a) * std::cos(b), -std::cos(a) * std::cos(b), std::sin(b)))
                .norm(),
            1e-12);
  file.set_text({0x0018, 0x1521}, "DS", "0\\0.5");
  EXPECT_THAT(refusal(file), HasSubstr("one per frame: 3"));
  file.set_text({0x0028, 0x0008}, "IS", "999999999999");
  EXPECT_THAT(refusal(file), HasSubstr("100000"));
}

/// An enhanced XA image of two frames: what both share stands once, the angles per frame.
test::DicomTestFile enhanced(const test::DicomTestFile& plain, const char* second_primary) {
  test::DicomTestFile file = plain;
  for (const auto& tag : {test::DicomTestFile::Tag{0x0018, 0x1110},
                          {0x0018, 0x1111},
                          {0x0018, 0x1164},
                          {0x0018, 0x1500},
                          {0x0018, 0x1510},
                          {0x0018, 0x1511}})
    file.erase(tag);
  file.set_text({0x0028, 0x0008}, "IS", "2");
  test::DicomTestFile geometry;
  geometry.set_text({0x0018, 0x1110}, "DS", "1200");
  geometry.set_float({0x0018, 0x9402}, 800.0f);
  test::DicomTestFile pixels;
  pixels.set_text({0x0018, 0x1164}, "DS", "0.4\\0.3");
  test::DicomTestFile shared;
  shared.set_items({0x0018, 0x9476}, {geometry}, true);
  shared.set_items({0x0028, 0x9443}, {pixels});
  file.set_items({0x5200, 0x9229}, {shared});
  std::vector<test::DicomTestFile> frames;
  for (const char* const primary : {"0", second_primary}) {
    test::DicomTestFile angles;
    angles.set_text({0x0018, 0x1510}, "DS", primary);
    angles.set_text({0x0018, 0x1511}, "DS", "0");
    frames.emplace_back();
    frames.back().set_items({0x0018, 0x9405}, {angles});
  }
  file.set_items({0x5200, 0x9230}, frames, true);
  return file;
}

TEST_F(DicomCameras, EnhancedFilesHaveACameraPerFrame) {
  const CameraRig rig = read(enhanced(xa(), "90"));
  ASSERT_EQ(rig.cameras.size(), 2U);
  const double scale = 1200.0 / (800 - 20);
  expect_dicom_pixel(
      rig.cameras[0], {10, 20, 30}, {199.5 + 10 * scale / 0.3, 255.5 - 30 * scale / 0.4});
  EXPECT_LT((rig.cameras[1].source_point - Vector3d(-800, 0, 0)).norm(), 1e-9) << "LAO 90";
  EXPECT_EQ(read(enhanced(xa(), "0")).cameras.size(), 1U) << "nothing moves";
  test::DicomTestFile both = enhanced(xa(), "90");
  both.set_text({0x0018, 0x1164}, "DS", "0.8\\0.6");
  EXPECT_EQ(read(both).cameras[0].pixel_spacing_mm, Vector2d(0.3, 0.4)) << "the frame's own";
}

TEST_F(DicomCameras, AnglesOfTheEquipmentAreNotThoseOfThePatient) {
  test::DicomTestFile file = enhanced(xa(), "90");
  test::DicomTestFile isocenter;
  isocenter.set_float({0x0018, 0x9463}, 30.0f);
  isocenter.set_float({0x0018, 0x9465}, 5.0f);
  test::DicomTestFile frame;
  frame.set_items({0x0018, 0x9462}, {isocenter});
  test::DicomTestFile only_isocenter = file;
  only_isocenter.set_items({0x5200, 0x9230}, {frame, frame});
  EXPECT_THAT(refusal(only_isocenter), HasSubstr("are of the equipment, not of the patient"));
  CameraFileOptions options;
  options.positioner_deg = {0.0, 0.0};
  EXPECT_EQ(read(only_isocenter, options).cameras.size(), 1U);
  EXPECT_THAT(warnings(), testing::Contains(HasSubstr("= 5 degrees is not applied")));
}

TEST_F(DicomCameras, FieldOfViewMovesTheImageOnTheDetector) {
  test::DicomTestFile file = xa();
  // A detector of 300 x 400 mm in elements of 0.2 mm; the image begins 200 rows and 900 columns in.
  file.set_text({0x0018, 0x7022}, "DS", "0.2\\0.2");
  file.set_text({0x0018, 0x7026}, "DS", "300\\400");
  file.set_text({0x0018, 0x7028}, "DS", "0\\0");
  file.set_text({0x0018, 0x7030}, "DS", "200\\900");
  const CameraGeometry camera = read(file).cameras.front();
  // The detector's middle, where the isocentre is seen, is (200, 150) mm in; the image begins at
  // (180, 40) mm, and its first pixel's centre half a pixel later.
  expect_dicom_pixel(camera, {0, 0, 0}, {20.0 / 0.3 - 0.5, 110.0 / 0.4 - 0.5});
}

TEST_F(DicomCameras, FieldOfViewOfAFrameIsThatOfItsFunctionalGroups) {
  test::DicomTestFile field;
  field.set_text({0x0018, 0x7030}, "DS", "200\\900");
  test::DicomTestFile file = enhanced(xa(), "90");
  file.set_text({0x0018, 0x7022}, "DS", "0.2\\0.2");
  file.set_text({0x0018, 0x7026}, "DS", "300\\400");
  file.set_text({0x0018, 0x7028}, "DS", "0\\0");
  std::vector<test::DicomTestFile> frames;
  for (const char* const primary : {"0", "90"}) {
    test::DicomTestFile angles;
    angles.set_text({0x0018, 0x1510}, "DS", primary);
    angles.set_text({0x0018, 0x1511}, "DS", "0");
    frames.emplace_back();
    frames.back().set_items({0x0018, 0x9405}, {angles});
  }
  frames[1].set_items({0x0018, 0x9432}, {field});
  file.set_items({0x5200, 0x9230}, frames, true);
  const CameraRig rig = read(file);
  ASSERT_EQ(rig.cameras.size(), 2U);
  expect_dicom_pixel(rig.cameras[0], {0, 0, 0}, {199.5, 255.5});
  // As FieldOfViewMovesTheImageOnTheDetector.
  expect_dicom_pixel(rig.cameras[1], {0, 0, 0}, {20.0 / 0.3 - 0.5, 110.0 / 0.4 - 0.5});
}

TEST_F(DicomCameras, FieldOfViewOriginIsOfTheDetectorBeforeTurnAndFlip) {
  test::DicomTestFile file = xa();
  file.set_text({0x0018, 0x7022}, "DS", "0.2\\0.2");
  file.set_text({0x0018, 0x7026}, "DS", "300\\400");
  file.set_text({0x0018, 0x7028}, "DS", "0\\0");
  file.set_text({0x0018, 0x7030}, "DS", "200\\900");
  // The image's middle lies at column 240, row 142.4 mm: 40 to the right of and 7.6 above the
  // detector's, which is seen the other way round in a flipped or turned image.
  const Vector2d middle(199.5, 255.5);
  const Vector2d offset(40.0 / 0.3, -7.6 / 0.4);
  file.set_text({0x0018, 0x7034}, "CS", "YES");
  expect_dicom_pixel(
      read(file).cameras.front(), {0, 0, 0}, middle + Vector2d(offset.x(), -offset.y()));
  file.set_text({0x0018, 0x7032}, "DS", "180");
  expect_dicom_pixel(
      read(file).cameras.front(), {0, 0, 0}, middle + Vector2d(-offset.x(), offset.y()));
  file.set_text({0x0018, 0x7032}, "DS", "90");
  EXPECT_THAT(refusal(file), HasSubstr("FieldOfViewRotation (0018,7032)"));
}

TEST_F(DicomCameras, WhatIsMissingIsAskedForByName) {
  const auto without = [&](test::DicomTestFile::Tag tag) {
    test::DicomTestFile file = xa();
    file.erase(tag);
    return file;
  };
  EXPECT_THAT(refusal(without({0x0018, 0x1110})), HasSubstr("--rig-source-detector-mm"));
  EXPECT_THAT(refusal(without({0x0018, 0x1111})), HasSubstr("--rig-source-isocenter-mm"));
  EXPECT_THAT(refusal(without({0x0018, 0x1164})), HasSubstr("--rig-pixel-spacing-mm"));
  EXPECT_THAT(refusal(without({0x0018, 0x1510})), HasSubstr("--rig-positioner-deg"));
  EXPECT_THAT(refusal(without({0x0028, 0x0010})), HasSubstr("Rows (0028,0010)"));

  test::DicomTestFile bare = xa();
  for (const int element : {0x1110, 0x1111, 0x1164, 0x1510, 0x1511})
    bare.erase({0x0018, static_cast<std::uint16_t>(element)});
  CameraFileOptions options;
  options.source_detector_mm = 1200.0;
  options.source_isocenter_mm = 800.0;
  options.pixel_spacing_mm = {0.3, 0.4};
  options.positioner_deg = {0.0, 0.0};
  EXPECT_LT((read(bare, options).cameras[0].project({10, 20, 30}) -
             read(xa()).cameras[0].project({10, 20, 30}))
                .norm(),
            kConventionPx);
}

TEST_F(DicomCameras, Refusals) {
  test::DicomTestFile file = xa();
  CameraFileOptions options;
  options.source_detector_mm = 1000.0;
  EXPECT_THAT(refusal(file, options), HasSubstr("must agree"));
  file.set_text({0x0018, 0x1164}, "DS", "0.4\\-1");
  EXPECT_THAT(refusal(file),
              HasSubstr("ImagerPixelSpacing (0018,1164) = '0.4\\-1': must be two positive"));
  file.set_text({0x0018, 0x1164}, "DS", "0.4\\nan");
  EXPECT_THAT(refusal(file), HasSubstr("finite"));
  file = xa();
  file.set_text({0x0018, 0x1510}, "DS", "1e9");
  EXPECT_THAT(refusal(file), HasSubstr("360"));
  file = xa();
  file.set_text({0x0018, 0x1111}, "DS", "1e300");
  EXPECT_THAT(refusal(file), HasSubstr("1e6 mm"));
  file = xa();
  file.write(folder() / "cut.dcm");
  std::filesystem::resize_file(folder() / "cut.dcm",
                               std::filesystem::file_size(folder() / "cut.dcm") - 3);
  EXPECT_THAT(test::message_of<FileError>(
                  [&] { (void)read_camera_files({folder() / "cut.dcm"}, {}, nullptr); }),
              HasSubstr("truncated"));
}

}  // namespace
}  // namespace af
