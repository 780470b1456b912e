// SPDX-License-Identifier: Apache-2.0
#include "geometry/fiducial_registration.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>

#include "base/error.h"

namespace af {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// For two rays at angle a, the smallest eigenvalue of sum(I - d d^T) is 1 - cos(a). This is its
// value at 1 degree, to second order.
constexpr double kSmallestRayEigenvalue = kRadPerDeg * kRadPerDeg / 2.0;

// Points count as collinear when they spread across a line by less than this share of their length.
// Rounding or detection noise would then decide the rotation about that line.
constexpr double kCollinearRatio = 1e-3;

Matrix3d across(const Ray& ray) {
  return Matrix3d::Identity() - ray.direction * ray.direction.transpose();
}

Vector3d mean(std::span<const Vector3d> points) {
  Vector3d sum = Vector3d::Zero();
  for (const Vector3d& point : points) sum += point;
  return sum / static_cast<double>(points.size());
}

bool are_collinear(std::span<const Vector3d> points) {
  Matrix3d scatter = Matrix3d::Zero();
  const Vector3d center = mean(points);
  for (const Vector3d& point : points) scatter += (point - center) * (point - center).transpose();
  // Ascending: the middle eigenvalue is the second largest squared spread.
  const Vector3d spread =
      Eigen::SelfAdjointEigenSolver<Matrix3d>(scatter, Eigen::EigenvaluesOnly).eigenvalues();
  return !(std::sqrt(std::max(0.0, spread[1])) > kCollinearRatio * std::sqrt(spread[2]));
}

void refuse_unusable(std::span<const Vector3d> points, const char* which) {
  for (const Vector3d& point : points)
    if (!point.allFinite())
      throw InputError(std::string("fiducials: ") + which + " points must be finite");
  if (are_collinear(points))
    throw InputError(std::string("fiducials: the ") + which +
                     " points are collinear: they must span a plane to fix a rotation");
}

}  // namespace

BackProjection back_project(std::span<const Ray> rays) {
  if (rays.size() < 2)
    throw InputError("fiducials: back-projection needs at least two views, found " +
                     std::to_string(rays.size()));
  Matrix3d normal = Matrix3d::Zero();
  Vector3d right = Vector3d::Zero();
  for (const Ray& ray : rays) {
    normal += across(ray);
    right += across(ray) * ray.origin_point;
  }
  const Eigen::SelfAdjointEigenSolver<Matrix3d> solver(normal);
  if (!(solver.eigenvalues()[0] > kSmallestRayEigenvalue))
    throw InputError("fiducials: the views' rays are parallel within 1 degree; no point is fixed");

  BackProjection result;
  result.room_point = normal.ldlt().solve(right);
  double squared_distances = 0.0;
  for (const Ray& ray : rays) {
    const Vector3d offset = result.room_point - ray.origin_point;
    if (!(offset.dot(ray.direction) > 0.0))
      throw InputError("fiducials: the views' rays meet behind an X-ray source");
    squared_distances += (across(ray) * offset).squaredNorm();
  }
  result.ray_gap_mm = 2.0 * std::sqrt(squared_distances / static_cast<double>(rays.size()));
  return result;
}

RigidFit fit_rigid(std::span<const Vector3d> target_points,
                   std::span<const Vector3d> source_points) {
  if (target_points.size() != source_points.size())
    throw InputError("fiducials: " + std::to_string(target_points.size()) + " target points but " +
                     std::to_string(source_points.size()) + " source points");
  if (source_points.size() < 3)
    throw InputError("fiducials: a rigid fit needs at least three points, found " +
                     std::to_string(source_points.size()));
  refuse_unusable(source_points, "ct");
  refuse_unusable(target_points, "room");

  const Vector3d source_center = mean(source_points);
  const Vector3d target_center = mean(target_points);
  Matrix3d covariance = Matrix3d::Zero();
  for (std::size_t i = 0; i < source_points.size(); ++i)
    covariance +=
        (target_points[i] - target_center) * (source_points[i] - source_center).transpose();
  const Eigen::JacobiSVD<Matrix3d, Eigen::NoQRPreconditioner> svd(
      covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Matrix3d handedness = Matrix3d::Identity();
  handedness(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0 ? -1.0 : 1.0;

  RigidFit fit;
  fit.target_from_source.linear() = svd.matrixU() * handedness * svd.matrixV().transpose();
  fit.target_from_source.translation() =
      target_center - fit.target_from_source.linear() * source_center;
  double squared_sum = 0.0;
  for (std::size_t i = 0; i < source_points.size(); ++i) {
    fit.residuals_mm.push_back(
        (fit.target_from_source * source_points[i] - target_points[i]).norm());
    squared_sum += fit.residuals_mm.back() * fit.residuals_mm.back();
  }
  fit.fre_mm = std::sqrt(squared_sum / static_cast<double>(source_points.size()));
  return fit;
}

std::vector<double> leave_one_out_errors_mm(std::span<const Vector3d> target_points,
                                            std::span<const Vector3d> source_points) {
  check(target_points.size() == source_points.size(), "points come in pairs");
  std::vector<double> errors_mm;
  if (source_points.size() < 4) return errors_mm;
  for (std::size_t left_out = 0; left_out < source_points.size(); ++left_out) {
    std::vector<Vector3d> targets(target_points.begin(), target_points.end());
    std::vector<Vector3d> sources(source_points.begin(), source_points.end());
    targets.erase(targets.begin() + static_cast<std::ptrdiff_t>(left_out));
    sources.erase(sources.begin() + static_cast<std::ptrdiff_t>(left_out));
    if (are_collinear(targets) || are_collinear(sources)) return {};
    const RigidFit fit = fit_rigid(targets, sources);
    errors_mm.push_back(
        (fit.target_from_source * source_points[left_out] - target_points[left_out]).norm());
  }
  return errors_mm;
}

std::vector<std::size_t> fiducials_in_two_views(std::span<const FiducialView> views,
                                                std::size_t fiducial_count) {
  for (const FiducialView& view : views)
    if (view.fiducials_px.size() != fiducial_count)
      throw InputError(
          "fiducials_px of camera '" + view.camera.name + "'",
          std::to_string(view.fiducials_px.size()) + " entries",
          "must be as many as fiducials_ct_mm (" + std::to_string(fiducial_count) + ")");
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < fiducial_count; ++i) {
    const auto seen = std::count_if(views.begin(), views.end(), [&](const FiducialView& view) {
      return is_seen(view.fiducials_px[i]);
    });
    if (seen >= 2) found.push_back(i);
  }
  return found;
}

FiducialGold gold_from_fiducials(std::span<const FiducialView> views,
                                 std::span<const Vector3d> fiducials_ct_mm) {
  FiducialGold gold;
  gold.used = fiducials_in_two_views(views, fiducials_ct_mm.size());
  if (gold.used.size() < kFewestFiducials)
    throw InputError("fiducials: a pose needs at least three that two views show, found " +
                     std::to_string(gold.used.size()));
  std::vector<Vector3d> room_points;
  std::vector<Vector3d> ct_points;
  for (const std::size_t i : gold.used) {
    std::vector<Ray> rays;
    for (const FiducialView& view : views)
      if (is_seen(view.fiducials_px[i]))
        rays.push_back(view.camera.ray(view.fiducials_px[i].x(), view.fiducials_px[i].y()));
    gold.back_projections.push_back(back_project(rays));
    room_points.push_back(gold.back_projections.back().room_point);
    ct_points.push_back(fiducials_ct_mm[i]);
  }
  gold.fit = fit_rigid(room_points, ct_points);
  gold.room_from_ct = gold.fit.target_from_source;
  gold.leave_one_out_mm = leave_one_out_errors_mm(room_points, ct_points);
  return gold;
}

}  // namespace af
