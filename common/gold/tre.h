// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "geometry/rigid_transform.h"

namespace af {

/// Target registration error (mm): the mean over the target points of the distance between where
/// two poses put them, mean |room_from_ct x - gold x| = mean |dR x + dt|. NaN when a pose has
/// values that are not finite. Throws InputError without points.
/// \test MeanTre.OfATranslationIsItsLength
double mean_tre_mm(const RigidTransform& room_from_ct,
                   const RigidTransform& gold_room_from_ct,
                   std::span<const Eigen::Vector3d> points_ct_mm);

}  // namespace af
