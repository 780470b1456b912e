// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "ct/ct_volume.h"
#include "geometry/ct_box.h"

namespace af {

/// The defaults do not fold space: the slopes of wave and ramp add up to less than 1.
struct SmoothMotionOptions {
  double amplitude_mm = 6.0;     ///< largest displacement along each axis
  double wavelength_mm = 160.0;  ///< of the displacement
  double margin_mm = 5.0;        ///< around the target box; it stays still too
  double ramp_mm = 40.0;         ///< from still to full displacement
  int threads = 0;               ///< 0: as many as the hardware has; voxels do not depend on it
};

/// A smooth displacement of the ct frame that is zero in and near a box: breathing, say, around a
/// vertebra that keeps its place. Along each axis it is a plane wave of drawn direction and phase,
/// times a ramp over the distance from the box. Slope and curvature of the ramp are continuous.
class SmoothMotion {
 public:
  /// Waves are keyed by (seed, key).
  SmoothMotion(const CtBox& still_box_ct,
               const SmoothMotionOptions& options,
               std::uint64_t seed,
               std::uint64_t key);

  /// Displacement (ct, mm) at a point. \test SmoothMotion.VanishesInTheTargetBoxAndItsMargin
  [[nodiscard]] Eigen::Vector3d displacement_mm(const Eigen::Vector3d& ct_point_mm) const;

  /// Moves points at equal distances on a line (at least two) by their displacements, to 1e-12 mm.
  /// \test SmoothMotion.DisplacesALineAsItsPoints
  void displace(std::span<Eigen::Vector3d> line_ct_mm) const;

  /// An upper bound of all displacements.
  [[nodiscard]] double largest_mm() const;

  /// The anatomy that shows at x what `ct` has at x + displacement(x), trilinear, with edges
  /// replicated. Voxels without displacement keep their value.
  [[nodiscard]] CtVolume moved(const CtVolume& ct) const;

 private:
  [[nodiscard]] double ramp(const Eigen::Vector3d& ct_point_mm) const;

  CtBox still_box_ct_;
  SmoothMotionOptions options_;
  std::array<Eigen::Vector3d, 3> wave_vectors_per_mm_;  ///< rad per mm
  Eigen::Vector3d phases_rad_;
};

}  // namespace af
