// SPDX-License-Identifier: Apache-2.0
// The rays that a field holds decide what it can be used for, not the camera that it was made for.
#pragma once

#include <cstdint>
#include <string>

#include "geometry/light_slab.h"
#include "geometry/motion_range.h"

namespace af {

/// Whether the light slab holds all rays of the detector wherever the CT is within `range` about
/// the nominal pose of `frame`. Every ray must meet every plane within its rectangle, and its
/// source must lie in front of all attenuation. Computed as planes are sized (hit_extents), not
/// from sampled poses. \test RayCoverage.SaysWhatSampledRaysSay
bool covers_range(const LightSlab& light_slab,
                  const CameraGeometry& camera,
                  const PoseFrame& frame,
                  const MotionRange& range);

/// The largest box about the nominal pose of `frame` whose poses are all covered: angles and
/// translations to both sides in the proportion of `proportion`, at most 60 degrees. Its bounds may
/// be too small by the share `kCoveredBoxTolerance`, but never too large. It has size 0 when at
/// most the nominal pose is covered; covers_range() tells whether that is.
MotionRange covered_box(const LightSlab& light_slab,
                        const CameraGeometry& camera,
                        const PoseFrame& frame,
                        const MotionRange& proportion);
inline constexpr double kCoveredBoxTolerance = 2e-3;

/// "field covers 100 % of camera A's rays within 6.2 deg / 18 mm of nominal" for a box. Where not
/// even the nominal pose is fully covered, it says what share is. Numbers are rounded down.
std::string coverage_text(const std::string& camera,
                          std::int64_t rays_inside,
                          std::int64_t rays,
                          const MotionRange& box);

}  // namespace af
