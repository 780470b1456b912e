// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <vector>

#include "geometry/ct_box.h"

namespace af {

inline constexpr double kTargetPointSpacingMm = 2.0;

/// Says in words which rule this target box breaks; empty when it breaks none. Low must lie below
/// high, no side may be longer than a CT can be, and the points must fit into memory.
std::string target_box_problem(const CtBox& box, double max_spacing_mm = kTargetPointSpacingMm);

/// The points that stand for a target box (ct frame, mm): the centres of equal cells whose sides
/// are at most `max_spacing_mm`. Differs from the paper, which averages over the CT's voxels in the
/// box: a mean over cells does not depend on the CT's resolution. Throws InputError for a box that
/// target_box_problem() rejects. \test TargetBox.PointsAreTheCentresOfEqualCells
std::vector<Eigen::Vector3d> target_points(const CtBox& box,
                                           double max_spacing_mm = kTargetPointSpacingMm);

/// Mean of one or more points. \test TargetBox.CenterIsTheMeanOfItsPoints
Eigen::Vector3d mean_point(std::span<const Eigen::Vector3d> points);

/// Root mean square distance (mm) of the box's points from `center_ct_mm`, exact. It turns a
/// rotation about that point into a distance.
double rms_radius_mm(const CtBox& box, const Eigen::Vector3d& center_ct_mm);

}  // namespace af
