// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "drr/drr_renderer.h"
#include "geometry/motion_range.h"
#include "xray/psnr.h"

namespace af::evaluation {

/// Poses with less foreground than this say nothing about a field, so others are drawn instead.
inline constexpr double kLeastForegroundFraction = 0.01;

/// Random pose `attempt` of item `index`: uniform and independent in the six parameters over the
/// motion box. It depends only on (seed, index, attempt).
PoseParameters random_pose_in_range(const MotionRange& range,
                                    std::uint64_t seed,
                                    std::uint64_t index,
                                    std::uint64_t attempt = 0);

/// How closely a DRR matches its reference at one pose.
struct DrrComparison {
  PoseParameters parameters;
  int redrawn = 0;                ///< random poses discarded for too little foreground
  std::int64_t rays_outside = 0;  ///< > 0: the field does not cover this pose, and the rest is NaN
  double psnr_db = std::numeric_limits<double>::quiet_NaN();  ///< infinity: equal images
  double rms_difference = std::numeric_limits<double>::quiet_NaN();
  double mean_difference = std::numeric_limits<double>::quiet_NaN();     ///< DRR - reference
  double largest_difference = std::numeric_limits<double>::quiet_NaN();  ///< absolute value
  double reference_maximum = std::numeric_limits<double>::quiet_NaN();   ///< I_max
  double foreground_fraction = std::numeric_limits<double>::quiet_NaN();
  double tested_seconds = 0.0;  ///< wall time of the two DRRs
  double reference_seconds = 0.0;

  auto members() {
    return std::tie(parameters,
                    redrawn,
                    rays_outside,
                    psnr_db,
                    rms_difference,
                    mean_difference,
                    largest_difference,
                    reference_maximum,
                    foreground_fraction,
                    tested_seconds,
                    reference_seconds);
  }
};

/// Compares two renderers of one view. One object per thread.
class DrrComparer {
 public:
  DrrComparer(const DrrRenderer& tested, const DrrRenderer& reference, const View& view);

  /// Compares at given parameters. A pose that the tested renderer does not cover is reported as
  /// such.
  DrrComparison at_pose(const PoseFrame& frame, const PoseParameters& parameters);
  /// Compares at random pose `index`, drawn again while the reference has too little foreground.
  /// Throws NumericError after 1000 draws, and when a pose of the motion box is not covered.
  DrrComparison at_random_pose(const PoseFrame& frame,
                               const MotionRange& range,
                               std::uint64_t seed,
                               std::uint64_t index);

  /// The images of the latest comparison.
  [[nodiscard]] const Image2d& tested_image() const { return tested_image_; }
  [[nodiscard]] const Image2d& reference_image() const { return reference_image_; }

 private:
  const DrrRenderer& tested_;
  const DrrRenderer& reference_;
  View view_;
  std::unique_ptr<RenderWorkspace> tested_workspace_;
  std::unique_ptr<RenderWorkspace> reference_workspace_;
  Image2d tested_image_;
  Image2d reference_image_;
};

}  // namespace af::evaluation
