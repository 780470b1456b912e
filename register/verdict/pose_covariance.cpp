// SPDX-License-Identifier: Apache-2.0
#include "register/verdict/pose_covariance.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "geometry/camera_geometry.h"

namespace af::registration {
namespace {

constexpr double kNormalQuantile95 = 1.6448536269514722;
constexpr double kNormalHalfWidth95 = 1.959963984540054;

using MotionMatrix = Eigen::Matrix<double, 3, 6>;

/// How small (rx, ry, rz, tx, ty, tz) move a point at `arm` from the centre.
MotionMatrix motion_of(const Eigen::Vector3d& arm) {
  MotionMatrix motion = MotionMatrix::Zero();
  for (int k = 0; k < 3; ++k) {
    motion.col(k) = Eigen::Vector3d::Unit(k).cross(arm);
    motion.col(k + 3) = Eigen::Vector3d::Unit(k);
  }
  return motion;
}

/// 1 for mm, and degrees per radian for the rotations.
PoseVector units() {
  PoseVector result = PoseVector::Ones();
  result.head<3>().setConstant(kDegPerRad);
  return result;
}

}  // namespace

std::optional<PoseMatrix> sandwich_covariance(const PoseInformation& information) {
  const Eigen::LLT<PoseMatrix> curvature(information.curvature);
  if (curvature.info() != Eigen::Success) return std::nullopt;
  const PoseMatrix half = curvature.solve(information.scatter);
  const PoseMatrix covariance = curvature.solve(half.transpose());
  if (!covariance.allFinite()) return std::nullopt;
  return 0.5 * (covariance + covariance.transpose());
}

PoseMatrix shift_covariance(const PoseInformation& information,
                            std::span<const View> views,
                            std::span<const Eigen::Vector2d> shifts_mm) {
  const Eigen::LDLT<PoseMatrix> curvature(information.curvature);
  PoseMatrix covariance = PoseMatrix::Zero();
  for (std::size_t i = 0; i < views.size(); ++i) {
    const CameraGeometry& camera = views[i].camera;
    for (const int axis : {0, 1}) {
      PoseVector shift = PoseVector::Zero();
      shift.tail<3>() =
          (axis == 0 ? camera.column_direction : camera.row_direction) * shifts_mm[i][axis];
      const PoseVector error = curvature.solve(information.view_curvatures[i] * shift);
      covariance += error * error.transpose();
    }
  }
  return covariance;
}

PredictedTre predicted_tre(const PoseMatrix& covariance,
                           const PoseFrame& frame,
                           std::span<const Eigen::Vector3d> target_points_ct) {
  if (!covariance.allFinite()) return {};
  const RigidTransform room_from_ct = pose_from_parameters(frame, {});
  PoseMatrix mean_square = PoseMatrix::Zero();
  for (const Eigen::Vector3d& point : target_points_ct) {
    const MotionMatrix motion = motion_of(room_from_ct * point - frame.center_room_mm);
    mean_square += motion.transpose() * motion;
  }
  mean_square /= static_cast<double>(target_points_ct.size());
  const PoseMatrix product = mean_square * covariance;
  const double mean = product.trace();
  const double sum_of_squares = (product * product).trace();
  PredictedTre tre = {std::sqrt(std::max(0.0, mean)), 0.0};
  if (!(mean > 0.0) || !(sum_of_squares > 0.0)) return tre;
  const double ninth = 2.0 * sum_of_squares / (9.0 * mean * mean);
  tre.upper_95_mm =
      std::sqrt(mean * std::pow(1.0 - ninth + kNormalQuantile95 * std::sqrt(ninth), 3));
  return tre;
}

double depth_95_mm(const PoseMatrix& covariance,
                   const PoseFrame& frame,
                   const Eigen::Vector3d& point_ct_mm,
                   const Eigen::Vector3d& source_room_mm) {
  const Eigen::Vector3d point_room_mm = pose_from_parameters(frame, {}) * point_ct_mm;
  const PoseVector along_beam = motion_of(point_room_mm - frame.center_room_mm).transpose() *
                                (point_room_mm - source_room_mm).normalized();
  return kNormalHalfWidth95 * std::sqrt(along_beam.dot(covariance * along_beam));
}

std::array<double, 21> in_deg_mm(const PoseMatrix& covariance) {
  const PoseMatrix converted = units().asDiagonal() * covariance * units().asDiagonal();
  std::array<double, 21> upper_triangle{};
  std::size_t next = 0;
  for (int row = 0; row < 6; ++row)
    for (int column = row; column < 6; ++column) upper_triangle[next++] = converted(row, column);
  return upper_triangle;
}

PoseMatrix from_deg_mm(const std::array<double, 21>& upper_triangle) {
  PoseMatrix converted;
  std::size_t next = 0;
  for (int row = 0; row < 6; ++row)
    for (int column = row; column < 6; ++column)
      converted(row, column) = converted(column, row) = upper_triangle[next++];
  const PoseVector per_unit = units().cwiseInverse();
  return per_unit.asDiagonal() * converted * per_unit.asDiagonal();
}

double squared_distance(const PoseMatrix& covariance, const PoseVector& error) {
  return error.dot(covariance.ldlt().solve(error));
}

}  // namespace af::registration
