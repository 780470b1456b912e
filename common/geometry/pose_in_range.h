// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "base/hash_random.h"
#include "geometry/slab_sizing.h"

namespace af {

/// The pose of a range at a share of each axis' bounds, 0 at its low and 1 at its high one: three
/// rotations, then three translations.
PoseParameters pose_at(const MotionRange& range, const std::array<double, 6>& share);

/// The corner of a range whose `axis`th parameter is high where bit `axis` of `corner` is set,
/// otherwise low; corner < 64.
PoseParameters corner_pose(const MotionRange& range, unsigned corner);

/// Uniform within the range; takes six draws.
PoseParameters random_pose(const MotionRange& range, HashRandom& random);

}  // namespace af
