// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "ct/ct_volume.h"
#include "drr/drr_renderer.h"
#include "geometry/ct_box.h"
#include "geometry/rigid_transform.h"
#include "register/optimizer/optimizer.h"
#include "register/problem/multi_view_objective.h"

namespace af::registration {

/// How far one unit of each pose parameter moves the CT's projection, so that steps of all
/// parameters can be compared.
struct ParameterScaling {
  /// Mean displacement, in mm on the isocentre plane, per rad (rx, ry, rz) and per mm (tx, ty, tz).
  ScaledParameters displacement_mm = ScaledParameters::Ones();

  [[nodiscard]] PoseParameters unscaled(const ScaledParameters& point) const;
};

/// Points (ct frame, mm) that stand for the CT's voxels when steps are scaled: the centres of
/// `points_per_axis`^3 equal cells of the volume.
std::vector<Eigen::Vector3d> ct_lattice_points(const CtGrid& grid, int points_per_axis = 24);
/// The same for a box in the ct frame.
std::vector<Eigen::Vector3d> ct_lattice_points(const CtBox& box, int points_per_axis = 24);

/// Mean displacement at `room_from_ct` of those `points_ct` that project into the region of
/// interest of at least one view. It is taken to first order (for rotations about the room's axes
/// through `center_ct_mm`), on the plane through `isocenter_point` parallel to each view's
/// detector, and averaged over points and views (Sec. III-B2; docs/differences-from-the-paper.md
/// says what the paper leaves open). nullopt when no point projects into a region.
std::optional<ParameterScaling> projected_motion_scaling(const RigidTransform& room_from_ct,
                                                         const Eigen::Vector3d& center_ct_mm,
                                                         std::span<const Eigen::Vector3d> points_ct,
                                                         std::span<const View> views,
                                                         const Eigen::Vector3d& isocenter_point);

/// Six small motions (columns; rx, ry, rz about the room's axes through `center_ct_mm`, rad, then
/// tx, ty, tz, mm). Each moves the projections of the same points by 1 mm (root mean square over
/// points and views), independently of the others: the sum of their squared parameters is the mean
/// squared displacement. With a single view, one of them is nearly a translation along the beam.
/// nullopt when no point projects into a region. \test
/// ProjectedMotionBasis.MakesMotionsOfOneMillimetre
std::optional<PoseMatrix> projected_motion_basis(const RigidTransform& room_from_ct,
                                                 const Eigen::Vector3d& center_ct_mm,
                                                 std::span<const Eigen::Vector3d> points_ct,
                                                 std::span<const View> views,
                                                 const Eigen::Vector3d& isocenter_point);

/// The poses that a stage searches: scaled parameters about the stage's start, judged by its
/// objective. \test PoseTarget.DerivativesAreThoseOfItsValue
class PoseTarget final : public LeastSquaresTarget {
 public:
  PoseTarget(MultiViewObjective& objective, PoseFrame frame, const ParameterScaling& scaling);

  std::optional<double> evaluate(const ScaledParameters& point) override;
  void evaluate_all(std::span<const ScaledParameters> points,
                    std::span<std::optional<double>> values) override;
  /// Gives what is asked for as far as the objective's measures have it.
  std::optional<TargetValue> evaluate_with_gradient(const ScaledParameters& point) override {
    return evaluate_with(point, Derivatives::Gradient);
  }
  std::optional<TargetValue> evaluate_with_normal_equations(
      const ScaledParameters& point) override {
    return evaluate_with(point, Derivatives::NormalEquations);
  }
  /// Clamps to the motion ranges of all views.
  [[nodiscard]] ScaledParameters nearest_admissible(const ScaledParameters& point) const override;

  /// The parameters of the views' motion ranges that end within a step of a point.
  [[nodiscard]] ParameterSet limits_at(const ScaledParameters& point, double step_mm) const;

  [[nodiscard]] RigidTransform pose(const ScaledParameters& point) const;
  [[nodiscard]] std::int64_t drr_count() const { return drr_count_; }
  /// For the latest evaluation.
  [[nodiscard]] std::int64_t rays_outside() const { return rays_outside_; }

 private:
  std::optional<TargetValue> evaluate_with(const ScaledParameters& point, Derivatives derivatives);
  void count(const ObjectiveValue& value);

  MultiViewObjective& objective_;
  PoseFrame frame_;
  ParameterScaling scaling_;
  std::int64_t drr_count_ = 0;
  std::int64_t rays_outside_ = 0;
  std::vector<RigidTransform> poses_;   ///< reused
  std::vector<ObjectiveValue> values_;  ///< reused
};

}  // namespace af::registration
