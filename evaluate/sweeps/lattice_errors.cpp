// SPDX-License-Identifier: Apache-2.0
#include "evaluate/sweeps/lattice_errors.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Dense>

namespace af::evaluation {
namespace {

/// How far a camera moves along u, v, s or t of its field per rad or mm that the patient moves.
Eigen::Vector3d moved_by(int axis, const CameraGeometry& camera, const Eigen::Vector3d& center) {
  const Eigen::Vector3d along = axis % 2 == 0 ? camera.column_direction : camera.row_direction;
  if (axis >= 2) return -along;
  // When the patient turns by w, the source moves about the CT by -w x (source - center).
  return -(camera.source_point - center).cross(along);
}

}  // namespace

std::array<PoseParameters, kCellAxes> cell_steps(std::span<const CellView> views,
                                                 const Eigen::Vector3d& center_room_mm) {
  std::array<PoseParameters, kCellAxes> steps;
  const auto count = static_cast<Eigen::Index>(views.size());
  for (int axis = 0; axis < kCellAxes; ++axis) {
    Eigen::MatrixX3d motion(count, 3);
    Eigen::VectorXd cells(count);
    for (Eigen::Index i = 0; i < count; ++i) {
      const CellView& view = views[static_cast<std::size_t>(i)];
      motion.row(i) = moved_by(axis, view.camera, center_room_mm).transpose();
      cells[i] = view.spacing_mm[static_cast<std::size_t>(axis)];
    }
    const Eigen::Vector3d step = motion.completeOrthogonalDecomposition().solve(cells);
    PoseParameters& parameters = steps[static_cast<std::size_t>(axis)];
    (axis < 2 ? parameters.rotation_rad : parameters.translation_mm) = step;
  }
  return steps;
}

std::vector<LatticePose> lattice_poses(const std::array<PoseParameters, kCellAxes>& steps,
                                       int fractions) {
  std::vector<LatticePose> poses;
  for (int u = 0; u < fractions; ++u)
    for (int s = 0; s < fractions; ++s)
      for (int t = 0; t < fractions; ++t) {
        // An orthogonal array: any three of the four numbers determine the fourth.
        LatticePose pose = {{u, (u + s + t) % fractions, s, t}, {}};
        for (std::size_t axis = 0; axis < kCellAxes; ++axis) {
          const double cells = (pose.fraction[axis] + 0.5) / fractions - 0.5;
          pose.parameters.rotation_rad += cells * steps[axis].rotation_rad;
          pose.parameters.translation_mm += cells * steps[axis].translation_mm;
        }
        poses.push_back(pose);
      }
  return poses;
}

std::array<double, 6> amplitude_along(int axis,
                                      std::span<const LatticePose> poses,
                                      std::span<const std::array<double, 6>> errors,
                                      int fractions) {
  std::array<double, 6> amplitude{};
  for (std::size_t parameter = 0; parameter < amplitude.size(); ++parameter) {
    double low = std::numeric_limits<double>::infinity();
    double high = -low;
    for (int fraction = 0; fraction < fractions; ++fraction) {
      double sum = 0.0;
      int count = 0;
      for (std::size_t i = 0; i < poses.size(); ++i) {
        if (poses[i].fraction[static_cast<std::size_t>(axis)] != fraction ||
            std::isnan(errors[i][parameter]))
          continue;
        sum += errors[i][parameter];
        ++count;
      }
      if (count == 0) continue;
      low = std::min(low, sum / count);
      high = std::max(high, sum / count);
    }
    amplitude[parameter] = high < low ? std::numeric_limits<double>::quiet_NaN() : (high - low) / 2;
  }
  return amplitude;
}

}  // namespace af::evaluation
