// SPDX-License-Identifier: Apache-2.0
#include "geometry/camera_geometry.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>

#include <Eigen/Dense>

#include "base/error.h"
#include "base/named_rows.h"
#include "base/plausible.h"

namespace af {

namespace {

template <typename Vector>
std::string text_of(const Vector& vector) {
  std::ostringstream out;
  out << '[';
  for (Eigen::Index i = 0; i < vector.size(); ++i) out << (i > 0 ? ", " : "") << vector[i];
  out << ']';
  return out.str();
}

/// K and R of an invertible M = K R, where K is upper triangular with a positive diagonal. This is
/// the RQ decomposition: Gram-Schmidt from the last row on (Hartley and Zisserman, Multiple View
/// Geometry, 2nd ed., 6.2.4).
struct RqFactors {
  Eigen::Matrix3d intrinsics;
  Eigen::Matrix3d camera_from_room;
};

RqFactors rq_decomposition(const Eigen::Matrix3d& matrix) {
  const Eigen::Vector3d z = matrix.row(2).normalized();
  Eigen::Vector3d y = matrix.row(1).transpose() - matrix.row(1).dot(z) * z;
  y -= y.dot(z) * z;  // rounding leaves a part along z when rows are nearly parallel
  y.normalize();
  Eigen::Vector3d x = y.cross(z).normalized();
  if (matrix.row(0).dot(x) < 0.0) x = -x;

  RqFactors factors;
  factors.camera_from_room << x.transpose(), y.transpose(), z.transpose();
  factors.intrinsics =
      (matrix * factors.camera_from_room.transpose()).triangularView<Eigen::Upper>();
  return factors;
}

}  // namespace

Eigen::Vector3d CameraGeometry::detector_point(double column, double row) const {
  return detector_origin_point + column * pixel_spacing_mm.x() * column_direction +
         row * pixel_spacing_mm.y() * row_direction;
}

Ray CameraGeometry::ray(double column, double row) const {
  return {source_point, (detector_point(column, row) - source_point).normalized()};
}

Eigen::Vector2d CameraGeometry::project(const Eigen::Vector3d& room_point) const {
  const Eigen::Vector3d beam = beam_direction();
  const double scale =
      (detector_origin_point - source_point).dot(beam) / (room_point - source_point).dot(beam);
  const Eigen::Vector3d from_origin =
      source_point + scale * (room_point - source_point) - detector_origin_point;
  return {from_origin.dot(column_direction) / pixel_spacing_mm.x(),
          from_origin.dot(row_direction) / pixel_spacing_mm.y()};
}

Eigen::Vector3d CameraGeometry::beam_direction() const {
  const Eigen::Vector3d normal = column_direction.cross(row_direction).normalized();
  return is_mirrored() ? Eigen::Vector3d(-normal) : normal;
}

double CameraGeometry::source_detector_distance_mm() const {
  return (detector_origin_point - source_point).dot(beam_direction());
}

double CameraGeometry::depth_mm(const Eigen::Vector3d& room_point) const {
  return (room_point - source_point).dot(beam_direction());
}

double CameraGeometry::pixels_per_mm(const Eigen::Vector3d& room_point) const {
  return source_detector_distance_mm() / depth_mm(room_point) / pixel_spacing_mm.mean();
}

bool CameraGeometry::is_mirrored() const {
  return column_direction.cross(row_direction).dot(detector_origin_point - source_point) < 0.0;
}

std::array<Eigen::Vector3d, 4> CameraGeometry::detector_corner_points() const {
  const double last_column = size_px.x() - 0.5;
  const double last_row = size_px.y() - 0.5;
  return {detector_point(-0.5, -0.5),
          detector_point(last_column, -0.5),
          detector_point(-0.5, last_row),
          detector_point(last_column, last_row)};
}

CameraGeometry CameraGeometry::from_projection_matrix(
    const std::string& name,
    const Eigen::Matrix<double, 3, 4>& pixels_from_room,
    const Eigen::Vector2d& pixel_spacing_mm,
    const Eigen::Vector2i& size_px,
    const Eigen::Vector3d& isocenter_point) {
  const std::string field = "camera '" + name + "': projection_matrix";
  Eigen::Matrix<double, 3, 4> projection = pixels_from_room;
  if (!projection.allFinite()) throw InputError(field + " has values that are not finite");
  const Eigen::Vector4d isocenter(
      isocenter_point.x(), isocenter_point.y(), isocenter_point.z(), 1.0);
  if ((projection.row(2) * isocenter).value() < 0.0) projection *= -1.0;
  const Eigen::Matrix3d left = projection.leftCols<3>();
  const double row_norm = left.row(2).norm();
  if (!(std::abs(left.determinant()) > 1e-12 * std::pow(left.norm(), 3)) || !(row_norm > 0.0))
    throw InputError(field + " is singular: its left 3x3 part must be invertible");

  RqFactors factors = rq_decomposition(left / row_norm);
  factors.intrinsics /= factors.intrinsics(2, 2);
  const double focal_column_px = factors.intrinsics(0, 0);
  const double focal_row_px = factors.intrinsics(1, 1);
  // The camera's depth must grow where w grows. RQ keeps that direction, since K(2,2) > 0.
  const Eigen::Vector3d depth_direction = factors.camera_from_room.row(2);
  constexpr double kSkewTolerance = 1e-6;
  if (std::abs(factors.intrinsics(0, 1)) > kSkewTolerance * focal_column_px)
    throw InputError(field,
                     "skew of " + std::to_string(factors.intrinsics(0, 1)) + " px",
                     "pixel columns and rows must be orthogonal");
  const double distance_column_mm = focal_column_px * pixel_spacing_mm.x();
  const double distance_row_mm = focal_row_px * pixel_spacing_mm.y();
  constexpr double kAspectTolerance = 1e-2;
  if (std::abs(distance_column_mm - distance_row_mm) > kAspectTolerance * distance_column_mm)
    throw InputError(field,
                     "focal lengths " + std::to_string(focal_column_px) + " and " +
                         std::to_string(focal_row_px) + " px",
                     "must agree with pixel_spacing_mm to 1 %");

  CameraGeometry camera;
  camera.name = name;
  camera.size_px = size_px;
  camera.source_point = -left.inverse() * projection.col(3);
  camera.column_direction = factors.camera_from_room.row(0);
  camera.row_direction = factors.camera_from_room.row(1);
  // The stated spacings fix the detector's distance. Their ratio follows the matrix, because that
  // is the calibration.
  camera.pixel_spacing_mm = {pixel_spacing_mm.x(), distance_column_mm / focal_row_px};
  camera.detector_origin_point =
      camera.source_point + distance_column_mm * depth_direction -
      factors.intrinsics(0, 2) * camera.pixel_spacing_mm.x() * camera.column_direction -
      factors.intrinsics(1, 2) * camera.pixel_spacing_mm.y() * camera.row_direction;
  return camera;
}

std::vector<std::string> problems(const CameraGeometry& camera) {
  constexpr double kUnitTolerance = 1e-5;
  std::vector<std::string> found;
  const auto add =
      [&](const std::string& key, const std::string& value, const std::string& constraint) {
        found.push_back("camera '" + camera.name + "': " + key + " = " + value + ": " + constraint);
      };
  if (camera.name.empty()) add("name", "\"\"", "must not be empty");
  const auto check_point = [&](const std::string& key, const Eigen::Vector3d& point) {
    if (!std::all_of(point.begin(), point.end(), is_plausible_room_mm))
      add(key, text_of(point), kPlausibleRoom);
  };
  check_point("source_point", camera.source_point);
  check_point("detector_origin_point", camera.detector_origin_point);
  const bool column_unit = std::abs(camera.column_direction.norm() - 1.0) < kUnitTolerance;
  const bool row_unit = std::abs(camera.row_direction.norm() - 1.0) < kUnitTolerance;
  if (!column_unit) add("column_direction", text_of(camera.column_direction), "must have length 1");
  if (!row_unit) add("row_direction", text_of(camera.row_direction), "must have length 1");
  if (column_unit && row_unit) {
    const double cosine = camera.column_direction.dot(camera.row_direction);
    if (!(std::abs(cosine) < kUnitTolerance))
      add("row_direction",
          text_of(camera.row_direction),
          "must be orthogonal to column_direction " + text_of(camera.column_direction));
    else if (!(std::abs(camera.source_detector_distance_mm()) > 1e-3))
      add("source_point", text_of(camera.source_point), "must not lie on the detector plane");
  }
  if (!std::all_of(
          camera.pixel_spacing_mm.begin(), camera.pixel_spacing_mm.end(), is_plausible_spacing_mm))
    add("pixel_spacing_mm", text_of(camera.pixel_spacing_mm), kPlausibleSpacing);
  constexpr int kMaxSide = 32768;
  constexpr double kMaxPixels = 1 << 28;  // 1 GB as float
  if (camera.size_px.minCoeff() < 1 || camera.size_px.maxCoeff() > kMaxSide ||
      camera.size_px.cast<double>().prod() > kMaxPixels)
    add("size_px", text_of(camera.size_px), "must be between 1 and 32768, at most 2^28 pixels");
  if (!camera.distortion.is_none() && found.empty())
    if (const std::string problem = distortion_problem(camera); !problem.empty())
      add("distortion",
          text_of(
              Eigen::Map<const Eigen::Matrix<double, 8, 1>>(camera.distortion.coefficients.data())),
          problem);
  return found;
}

namespace {

bool is_equal_but_for_case(const std::string& a, const std::string& b) {
  const auto lower = [](char letter) {
    return letter >= 'A' && letter <= 'Z' ? static_cast<char>(letter - 'A' + 'a') : letter;
  };
  return std::equal(
      a.begin(), a.end(), b.begin(), b.end(), [&](char x, char y) { return lower(x) == lower(y); });
}

}  // namespace

const CameraGeometry& CameraRig::camera(const std::string& name) const {
  const CameraGeometry* alike = nullptr;
  int alike_count = 0;
  for (const CameraGeometry& candidate : cameras) {
    if (candidate.name == name) return candidate;
    if (!is_equal_but_for_case(candidate.name, name)) continue;
    alike = &candidate;
    ++alike_count;
  }
  if (alike_count == 1) return *alike;
  throw InputError("camera", name, "the rig has only: " + joined(names_of(cameras)));
}

std::vector<std::string> problems(const CameraRig& rig) {
  std::vector<std::string> found;
  const Eigen::Vector3d& isocenter = rig.isocenter_point;
  if (!std::all_of(isocenter.begin(), isocenter.end(), is_plausible_room_mm))
    found.push_back("isocenter_point = " + text_of(isocenter) + ": " + kPlausibleRoom);
  if (rig.cameras.empty()) found.emplace_back("the rig has no [[camera]]");
  std::set<std::string> names;
  for (const CameraGeometry& camera : rig.cameras) {
    if (!names.insert(camera.name).second)
      found.push_back("camera name = " + camera.name + ": must be unique within the rig");
    const auto of_camera = problems(camera);
    found.insert(found.end(), of_camera.begin(), of_camera.end());
  }
  return found;
}

}  // namespace af
