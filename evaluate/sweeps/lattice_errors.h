// SPDX-License-Identifier: Apache-2.0
// Whether registrations are biased towards the nodes of a field. True poses that differ by
// fractions of its cells tell this: the lattice causes the part of the error that depends on the
// fraction.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "geometry/camera_geometry.h"
#include "geometry/rigid_transform.h"

namespace af::evaluation {

/// The axes u, v, s and t.
inline constexpr int kCellAxes = 4;
inline constexpr std::array<const char*, kCellAxes> kCellAxisNames = {"u", "v", "s", "t"};

/// A camera and the distances of its field's nodes along u, v, s and t, mm.
struct CellView {
  CameraGeometry camera;
  std::array<double, kCellAxes> spacing_mm = {};
};

/// The smallest motions of the patient, relative to a pose about `center_room_mm`, that move each
/// camera by one cell of its field, as closely as one motion can. Along u and v they are rotations,
/// which move the sources about the CT; along s and t, translations. To first order.
/// \test LatticeErrors.StepsMoveEveryCameraByOneCell
std::array<PoseParameters, kCellAxes> cell_steps(std::span<const CellView> views,
                                                 const Eigen::Vector3d& center_room_mm);

/// A true pose within a cell.
struct LatticePose {
  std::array<int, kCellAxes> fraction = {};  ///< in `fractions` of a cell
  PoseParameters parameters;                 ///< relative to the cell's centre
};

/// fractions^3 poses about a cell's centre. Every fraction occurs equally often along each axis,
/// and so does every combination of fractions along two or three axes.
/// \test LatticeErrors.PosesAreBalanced
std::vector<LatticePose> lattice_poses(const std::array<PoseParameters, kCellAxes>& steps,
                                       int fractions);

/// Half the difference between the largest and the smallest mean error over the fractions along an
/// axis, for each parameter (deg, mm). `errors` are those of lattice_poses(), in the same order.
/// Poses whose error is NaN are left out.
/// \test LatticeErrors.AmplitudeIsThatOfAPatternAlongOneAxis
std::array<double, 6> amplitude_along(int axis,
                                      std::span<const LatticePose> poses,
                                      std::span<const std::array<double, 6>> errors,
                                      int fractions);

}  // namespace af::evaluation
