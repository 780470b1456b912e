// SPDX-License-Identifier: Apache-2.0
// The worked examples of docs/cameras.md: files as other programs write them, and where their
// cameras see a point, computed by hand or by the other program.
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "camera_files/camera_formats.h"
#include "support/io_checks.h"

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
  EXPECT_THAT(input_refusal(test::replaced(good, "[ 0., 0., 0.", "[ 0.1, 0., 0.")),
              HasSubstr("distortion"));
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

}  // namespace
}  // namespace af
