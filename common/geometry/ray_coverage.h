// SPDX-License-Identifier: Apache-2.0
// Which rays a field holds decides what it can be used for, not the camera it was made for.
#pragma once

#include <cstdint>
#include <string>

#include "geometry/light_slab.h"
#include "geometry/motion_range.h"

namespace af {

/// Whether all rays of the whole detector meet every plane of the light slab within its rectangle,
/// and their source is before all attenuation, wherever the CT is within `range` about the nominal
/// pose of `frame`. Computed as planes are sized (hit_extents), not from sampled poses. \test
/// RayCoverage.SaysWhatSampledRaysSay
bool covers_range(const LightSlab& light_slab,
                  const CameraGeometry& camera,
                  const PoseFrame& frame,
                  const MotionRange& range);

/// The largest box about the nominal pose of `frame` (angles and translations to both sides in the
/// proportion of `proportion`, at most 60 degrees) whose poses are all covered. Its bounds may be
/// too small by at most the share `kCoveredBoxTolerance`, but never too large. It has size 0 when
/// no more than the nominal pose is covered, or not even that; covers_range() tells which.
MotionRange covered_box(const LightSlab& light_slab,
                        const CameraGeometry& camera,
                        const PoseFrame& frame,
                        const MotionRange& proportion);
inline constexpr double kCoveredBoxTolerance = 2e-3;

/// "field covers 100 % of camera A's rays within 6.2 deg / 18 mm of nominal" of a box, or what
/// share of them where the nominal pose itself is not all covered. Numbers are rounded down.
std::string coverage_text(const std::string& camera,
                          std::int64_t rays_inside,
                          std::int64_t rays,
                          const MotionRange& box);

}  // namespace af
