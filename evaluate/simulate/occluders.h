// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "drr/drr_renderer.h"
#include "evaluate/simulate/fiducials.h"

namespace af {

/// A steel ball, ct frame (mm).
struct SteelBall {
  Eigen::Vector3d center_point = Eigen::Vector3d::Zero();
  double radius_mm = 1.5;

  /// Length (mm) of the half-line from `source_point` through `through_point` inside the ball. The
  /// source lies outside. \test SteelBall.ChordsHaveTheirClosedForm
  [[nodiscard]] double chord_length_mm(const Eigen::Vector3d& source_point,
                                       const Eigen::Vector3d& through_point) const;
};

/// Steel in the X-rays that the CT does not show.
struct SteelBodies {
  std::vector<SteelCylinder> cylinders;
  std::vector<SteelBall> balls;

  /// Sum of all chords (mm). Where bodies overlap, both count.
  [[nodiscard]] double chord_length_mm(const Eigen::Vector3d& source_point,
                                       const Eigen::Vector3d& through_point) const;
};

struct OccluderOptions {
  int rod_count = 2;
  double rod_diameter_mm = 4.0;
  double rod_length_mm = 150.0;
  int ball_count = 8;
  double ball_diameter_mm = 3.0;
};

/// Where bodies are placed so that every view's region of interest shows them.
struct OccluderSite {
  Eigen::Vector3d center_ct_mm = Eigen::Vector3d::Zero();
  double reach_mm = 0.0;  ///< half the side, at the centre, of the smallest region of interest
  std::vector<Eigen::Vector3d> beam_directions_ct;  ///< unit; one per view, through the centre
};

OccluderSite occluder_site(const std::vector<View>& views,
                           const RigidTransform& room_from_ct,
                           const Eigen::Vector3d& center_ct_mm);

/// Rods whose axes pass the centre at 0.2 to 0.6 of the site's reach (drawn uniformly). They make
/// at least 30 degrees with every beam if 1000 draws find such a direction. Keyed by (seed, key,
/// rod). They cross every view's region of interest. \test
/// PlacedRods.CrossTheRegionOfInterestOfEveryView
std::vector<SteelCylinder> place_rods(const OccluderSite& site,
                                      const OccluderOptions& options,
                                      std::uint64_t seed,
                                      std::uint64_t key);

/// Balls distributed uniformly in a sphere of 0.8 of the site's reach. They are at least 3
/// diameters apart, and 8 mm from the centres of `pins`, if 1000 draws find such a place. Keyed by
/// (seed, key, ball).
std::vector<SteelBall> place_balls(const OccluderSite& site,
                                   const std::vector<SteelCylinder>& pins,
                                   const OccluderOptions& options,
                                   std::uint64_t seed,
                                   std::uint64_t key);

}  // namespace af
