// SPDX-License-Identifier: Apache-2.0
#include "unit/evaluate/scan/calibration_distance.h"

#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/Dense>

#include "geometry/rigid_transform.h"

namespace af::test {

double calibration_distance_px(const CircularScan& scan,
                               const ScanCalibration& a,
                               const ScanCalibration& b,
                               double radius_mm,
                               double half_height_mm) {
  std::vector<Eigen::Vector3d> points;
  for (int corner = 0; corner < 8; ++corner)
    for (const double height : {-1.0, -0.5, 0.5, 1.0})
      points.emplace_back(radius_mm * std::cos(0.25 * std::numbers::pi * corner),
                          radius_mm * std::sin(0.25 * std::numbers::pi * corner),
                          height * half_height_mm);
  using Change = Eigen::Matrix<double, 7, 1>;  // three angles, three shifts, logarithm of the size
  const PoseFrame frame;
  const auto projections = [&](const ScanCalibration& calibration, const Change& change) {
    const RigidTransform motion =
        pose_from_parameters(frame, {change.head<3>(), change.segment<3>(3)});
    const double size = std::exp(change[6]);
    Eigen::VectorXd pixels(static_cast<Eigen::Index>(2 * points.size() * scan.angles_rad.size()));
    Eigen::Index next = 0;
    for (const double angle : scan.angles_rad) {
      const CameraGeometry camera = scan_camera(scan, calibration, angle);
      for (const Eigen::Vector3d& point : points) {
        pixels.segment<2>(next) = camera.project(motion * (size * point));
        next += 2;
      }
    }
    return pixels;
  };
  const Eigen::VectorXd wanted = projections(a, Change::Zero());
  Change change = Change::Zero();
  const auto residual = [&](const Change& tried) -> Eigen::VectorXd {
    return projections(b, tried) - wanted;
  };
  constexpr int kSteps = 4;  // of a nearly linear problem
  for (int step = 0; step < kSteps; ++step) {
    const Eigen::VectorXd now = residual(change);
    Eigen::MatrixXd slopes(now.size(), change.size());
    for (Eigen::Index i = 0; i < change.size(); ++i) {
      const double width = i < 3 || i == 6 ? 1e-5 : 1e-3;
      Change moved = change;
      moved[i] += width;
      slopes.col(i) = (residual(moved) - now) / width;
    }
    const Eigen::Matrix<double, 7, 7> normal = slopes.transpose() * slopes;
    change -= normal.ldlt().solve(slopes.transpose() * now);
  }
  const Eigen::VectorXd rest = residual(change);
  return std::sqrt(2.0 * rest.squaredNorm() / static_cast<double>(rest.size()));
}

}  // namespace af::test
