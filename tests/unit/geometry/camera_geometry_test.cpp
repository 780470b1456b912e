// SPDX-License-Identifier: Apache-2.0
#include "geometry/camera_geometry.h"

#include <cmath>
#include <limits>

#include <Eigen/Dense>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "base/hash_random.h"
#include "geometry/point_projector.h"
#include "geometry/rigid_transform.h"

namespace af {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using ProjectionMatrix = Eigen::Matrix<double, 3, 4>;

// Rounding of a few products of lengths up to 4000 mm, with a condition number of up to 1e5 in the
// inverse of a projection matrix (focal lengths are up to 1e4 px, directions are 1).
constexpr double kRayToleranceMm = 1e-6;
constexpr double kPixelTolerance = 1e-9;

enum class Handedness { Normal, Mirrored };

/// A camera about 1 to 4 m from its detector, in any direction, that looks past the origin.
CameraGeometry random_camera(HashRandom& random, Handedness handedness) {
  const Matrix3d axes = rotation_from_angles(
      {random.uniform(-3.0, 3.0), random.uniform(-1.5, 1.5), random.uniform(-3.0, 3.0)});
  CameraGeometry camera;
  camera.name = "random";
  camera.column_direction = axes.col(0);
  camera.row_direction = (handedness == Handedness::Mirrored ? -1.0 : 1.0) * axes.col(1);
  camera.pixel_spacing_mm = {random.uniform(0.2, 1.5), random.uniform(0.2, 1.5)};
  camera.size_px = {300, 200};
  camera.source_point =
      -random.uniform(500.0, 2500.0) * axes.col(2) + random.uniform(-50.0, 50.0) * axes.col(0);
  camera.detector_origin_point = random.uniform(200.0, 1500.0) * axes.col(2) -
                                 random.uniform(0.0, 300.0) * camera.column_direction -
                                 random.uniform(0.0, 300.0) * camera.row_direction;
  return camera;
}

/// Pixels from room mm, from first principles: u = f (x - s).column / (x - s).beam + ...
ProjectionMatrix projection_matrix(const CameraGeometry& camera) {
  const Vector3d beam = camera.beam_direction();
  const Vector3d to_origin = camera.detector_origin_point - camera.source_point;
  const double distance = to_origin.dot(beam);
  ProjectionMatrix matrix;
  for (int axis = 0; axis < 2; ++axis) {
    const Vector3d direction = axis == 0 ? camera.column_direction : camera.row_direction;
    const Vector3d row =
        (distance * direction - to_origin.dot(direction) * beam) / camera.pixel_spacing_mm[axis];
    matrix.row(axis) << row.transpose(), -row.dot(camera.source_point);
  }
  matrix.row(2) << beam.transpose(), -beam.dot(camera.source_point);
  return matrix;
}

/// Largest distance between the rays of two cameras through the same pixels, at the source and at
/// the detector of the first.
double ray_difference_mm(const CameraGeometry& a, const CameraGeometry& b) {
  double largest = (a.source_point - b.source_point).norm();
  for (const double column : {-0.5, 100.0, 299.5})
    for (const double row : {-0.5, 50.0, 199.5}) {
      const double length = (a.detector_point(column, row) - a.source_point).norm();
      largest = std::max(
          largest, length * (a.ray(column, row).direction - b.ray(column, row).direction).norm());
    }
  return largest;
}

CameraGeometry from_matrix(const CameraGeometry& like, const ProjectionMatrix& matrix) {
  return CameraGeometry::from_projection_matrix(
      like.name, matrix, like.pixel_spacing_mm, like.size_px, Vector3d::Zero());
}

/// An upright AP camera with round numbers.
CameraGeometry simple_camera() {
  CameraGeometry camera;
  camera.name = "AP";
  camera.source_point = {0.0, -650.0, 0.0};
  camera.detector_origin_point = {-127.5, 350.0, 127.5};
  camera.column_direction = {1.0, 0.0, 0.0};
  camera.row_direction = {0.0, 0.0, -1.0};
  camera.pixel_spacing_mm = {1.0, 1.0};
  camera.size_px = {256, 256};
  return camera;
}

class CameraHandedness : public testing::TestWithParam<Handedness> {};
INSTANTIATE_TEST_SUITE_P(Both,
                         CameraHandedness,
                         testing::Values(Handedness::Normal, Handedness::Mirrored));

TEST_P(CameraHandedness, ProjectInvertsRay) {
  HashRandom random(11);
  for (int i = 0; i < 100; ++i) {
    const CameraGeometry camera = random_camera(random, GetParam());
    const Vector2d pixel(random.uniform(-0.5, 299.5), random.uniform(-0.5, 199.5));
    const Ray ray = camera.ray(pixel.x(), pixel.y());
    const Vector3d point = ray.origin_point + random.uniform(100.0, 3000.0) * ray.direction;
    EXPECT_LT((camera.project(point) - pixel).norm(), kPixelTolerance);
  }
}

TEST_P(CameraHandedness, APointProjectorHasTheBitsOfItsCamera) {
  HashRandom random(7);
  for (int i = 0; i < 20; ++i) {
    const CameraGeometry camera = random_camera(random, GetParam());
    const PointProjector projector(camera);
    EXPECT_EQ(projector.beam_direction(), camera.beam_direction());
    for (int k = 0; k < 20; ++k) {
      const Vector3d point = camera.source_point +
                             random.uniform(0.1, 2.0) *
                                 (camera.detector_point(20.0 * k, 7.0 * k) - camera.source_point);
      EXPECT_EQ(projector.depth_mm(point), camera.depth_mm(point));
      EXPECT_EQ(projector.project(point), camera.project(point));
    }
  }
}

TEST_P(CameraHandedness, ProjectionMatrixGivesBackTheSameRays) {
  HashRandom random(12);
  for (int i = 0; i < 500; ++i) {
    const CameraGeometry camera = random_camera(random, GetParam());
    const CameraGeometry found = from_matrix(camera, projection_matrix(camera));
    EXPECT_LT(ray_difference_mm(camera, found), kRayToleranceMm) << "draw " << i;
    EXPECT_LT((camera.detector_origin_point - found.detector_origin_point).norm(), kRayToleranceMm);
    EXPECT_EQ(found.is_mirrored(), GetParam() == Handedness::Mirrored);
  }
}

TEST_P(CameraHandedness, NegatedOrScaledProjectionMatrixIsTheSameCamera) {
  HashRandom random(13);
  for (int i = 0; i < 100; ++i) {
    const CameraGeometry camera = random_camera(random, GetParam());
    for (const double factor : {-1.0, -37.5, 1e-4, 1e4}) {
      const CameraGeometry found = from_matrix(camera, factor * projection_matrix(camera));
      EXPECT_LT(ray_difference_mm(camera, found), kRayToleranceMm) << "factor " << factor;
      EXPECT_GT(found.depth_mm(Vector3d::Zero()), 0.0);
    }
  }
}

TEST_P(CameraHandedness, CameraOfAProjectionMatrixHasNoProblems) {
  HashRandom random(14);
  const CameraGeometry camera = random_camera(random, GetParam());
  EXPECT_THAT(problems(from_matrix(camera, projection_matrix(camera))), IsEmpty());
}

TEST(CameraGeometry, BeamDirectionPointsFromSourceToDetector) {
  CameraGeometry camera = simple_camera();
  EXPECT_LT((camera.beam_direction() - Vector3d(0.0, 1.0, 0.0)).norm(), 1e-15);
  EXPECT_FALSE(camera.is_mirrored());
  camera.column_direction = -camera.column_direction;
  EXPECT_LT((camera.beam_direction() - Vector3d(0.0, 1.0, 0.0)).norm(), 1e-15);
  EXPECT_TRUE(camera.is_mirrored());
  EXPECT_DOUBLE_EQ(camera.source_detector_distance_mm(), 1000.0);
}

TEST(CameraGeometry, ApImageHasTheHeadOnTopAndThePatientsRightOnTheLeft) {
  const CameraGeometry camera = simple_camera();
  const Vector2d center = camera.project(Vector3d::Zero());
  EXPECT_LT((center - Vector2d(127.5, 127.5)).norm(), kPixelTolerance);
  EXPECT_LT(camera.project({0.0, 0.0, 50.0}).y(), center.y());   // LPS: +z is towards the head
  EXPECT_LT(camera.project({-50.0, 0.0, 0.0}).x(), center.x());  // -x is the patient's right
}

TEST(CameraGeometry, CornersAreTheOuterEdgesOfCornerPixels) {
  const auto corners = simple_camera().detector_corner_points();
  EXPECT_EQ(corners[0], Vector3d(-128.0, 350.0, 128.0));
  EXPECT_EQ(corners[3], Vector3d(128.0, 350.0, -128.0));
}

TEST(CameraGeometry, MagnificationIsDetectorDistanceOverDepth) {
  const CameraGeometry camera = simple_camera();
  const double pixels = camera.project({10.0, 0.0, 0.0}).x() - camera.project(Vector3d::Zero()).x();
  EXPECT_NEAR(pixels, 10.0 * 1000.0 / 650.0, kPixelTolerance);
}

TEST(CameraGeometry, ProjectionMatrixThatIsNotACameraIsRefused) {
  const CameraGeometry camera = simple_camera();
  const ProjectionMatrix good = projection_matrix(camera);
  ProjectionMatrix bad = good;
  bad(1, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(from_matrix(camera, bad), InputError);
  bad = good;
  bad.row(1) = 2.0 * bad.row(0);
  EXPECT_THROW(from_matrix(camera, bad), InputError);
  EXPECT_THROW(from_matrix(camera, ProjectionMatrix::Zero()), InputError);
  bad = good;
  bad.row(0) += 0.01 * good.row(1);  // columns that lean by 1 %
  EXPECT_THROW(from_matrix(camera, bad), InputError);
  bad = good;
  bad.row(1) *= 1.05;  // pixels that are not square as stated
  EXPECT_THROW(from_matrix(camera, bad), InputError);
}

TEST(CameraGeometry, ProblemsNameKeyValueAndConstraint) {
  CameraGeometry camera = simple_camera();
  EXPECT_THAT(problems(camera), IsEmpty());
  camera.column_direction = {2.0, 0.0, 0.0};
  camera.pixel_spacing_mm = {0.0, 1.0};
  camera.size_px = {0, 40000};
  const auto found = problems(camera);
  EXPECT_THAT(found,
              Contains(HasSubstr("camera 'AP': column_direction = [2, 0, 0]: must have length 1")));
  EXPECT_THAT(found, Contains(HasSubstr("pixel_spacing_mm = [0, 1]: must be 0.01 to 100 mm")));
  EXPECT_THAT(found, Contains(HasSubstr("size_px = [0, 40000]: must be between 1 and 32768")));
}

TEST(CameraGeometry, ProblemsNameAxesThatAreNotOrthogonalAndASourceOnTheDetector) {
  CameraGeometry camera = simple_camera();
  camera.row_direction = Vector3d(1.0, 0.0, -1.0).normalized();
  EXPECT_THAT(problems(camera), Contains(HasSubstr("orthogonal")));
  camera = simple_camera();
  camera.source_point.y() = camera.detector_origin_point.y();
  EXPECT_THAT(problems(camera), Contains(HasSubstr("detector plane")));
  camera.source_point.y() = std::numeric_limits<double>::infinity();
  EXPECT_THAT(problems(camera), Contains(HasSubstr("source_point = [0, inf, 0]: must be finite")));
}

TEST(CameraRig, RefusesRepeatedNamesAndNoCameras) {
  CameraRig rig;
  EXPECT_THAT(problems(rig), Contains(HasSubstr("no [[camera]]")));
  rig.cameras = {simple_camera(), simple_camera()};
  EXPECT_THAT(problems(rig), Contains(HasSubstr("must be unique")));
}

TEST(CameraRig, ListsItsCamerasWhenAskedForAnother) {
  CameraRig rig;
  rig.cameras = {simple_camera()};
  EXPECT_EQ(rig.camera("AP").name, "AP");
  try {
    static_cast<void>(rig.camera("LAT"));
    FAIL() << "an unknown camera was accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("AP"));
  }
}

}  // namespace
}  // namespace af
