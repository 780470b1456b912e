// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "drr/drr_renderer.h"
#include "geometry/ct_box.h"
#include "geometry/ct_grid.h"
#include "geometry/rigid_transform.h"
#include "register/problem/multi_view_objective.h"
#include "xray/image2d.h"

namespace af::registration {

/// A coarser renderer of a view's image pyramid.
struct RendererLevel {
  std::shared_ptr<const DrrRenderer> renderer;
  double blur_sigma_mm = 0.0;  ///< of its DRRs, in mm on the isocentre plane
};

/// One X-ray of the problem. Pixels are the camera's; nothing is cropped yet.
struct RegistrationView {
  View view;  ///< camera and the study's region of interest
  /// The region at the nominal pose, not cut at the detector's edges, that follows the target box
  /// (region_at()). None: the region stays view.roi.
  std::optional<RegionOfInterest> target_region;
  Image2d xray;  ///< whole detector, attenuation domain (bright = attenuated)
  Image2d mask;  ///< whole detector, non-zero = used; empty: every pixel of the region
  /// `mask` that also hides the gold standard's markers; empty: the same. Used in stages of 400
  /// pixels or more, if it leaves three quarters of them.
  Image2d mask_without_markers;
  std::shared_ptr<const DrrRenderer> renderer;
  /// Distance at the isocentre (mm) between what the renderer interpolates: a field's (s,t) nodes,
  /// or the CT's voxels. Every level doubles it. 0: nothing is interpolated.
  double sample_spacing_mm = 0.0;
  std::vector<RendererLevel> coarse_levels;  ///< 1, 2, ... as far as stages and verdict need them
  /// Motion box of the renderer's field. None for ray casting, and none if the field was made for
  /// another camera, where rays alone decide.
  std::optional<MotionLimit> limit;
  /// A box of poses whose rays the field holds: `limit` or, for another camera, the largest one
  /// about the nominal pose. Starts are drawn from it. It limits nothing.
  std::optional<MotionLimit> reach;
  /// [level] Ray casting where a correction needs it, otherwise none.
  std::vector<std::shared_ptr<const DrrRenderer>> ray_casts;
  /// [level] Ray casting of the target box alone (of its bone, if it has some), blurred as the
  /// level's DRRs: levels 0 and 1. None where the CT is not at hand.
  std::vector<std::shared_ptr<const DrrRenderer>> target_casts;
  /// Range of the DRR at the nominal pose, over the region grown by half its size to every side. No
  /// X-ray changes it. None: whoever needs it makes that DRR.
  std::optional<ValueRange> drr_range;

  /// The widest region that presets' stages and the judge look at. A ray that a field misses there
  /// makes a pose inadmissible.
  [[nodiscard]] View widest_view() const;
};

/// Prefix of messages about a view: "view 'AP': ".
std::string view_name(const RegistrationView& view);

/// Everything that does not change between the starts of one case.
struct RegistrationProblem {
  std::string case_name;  ///< one of the keys of random numbers
  RigidTransform nominal_room_from_ct = RigidTransform::Identity();
  Eigen::Vector3d center_ct_mm = Eigen::Vector3d::Zero();     ///< c_roi: origin of all rotations
  Eigen::Vector3d isocenter_point = Eigen::Vector3d::Zero();  ///< room, mm
  std::vector<Eigen::Vector3d> scaling_points_ct;             ///< see ct_lattice_points()
  /// The same for what attenuates alone, where rays are cast: air around it has no extent there.
  std::vector<Eigen::Vector3d> attenuating_points_ct;
  std::vector<RegistrationView> views;
  std::optional<CtBox> target_box_ct;             ///< needed by regions that follow it
  std::vector<Eigen::Vector3d> target_points_ct;  ///< of the target box; needed by a correction
  std::vector<Eigen::Vector3d> cut_points_ct;     ///< see cut_points(); silhouettes leave them out
  std::optional<CtGrid> ct_grid;                  ///< none if nobody looked at the CT

  /// The frame of the parameters in results.
  [[nodiscard]] PoseFrame frame() const {
    return PoseFrame::about(nominal_room_from_ct, center_ct_mm);
  }
};

std::vector<std::string> problems(const RegistrationProblem& problem);

}  // namespace af::registration
