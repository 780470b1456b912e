// SPDX-License-Identifier: Apache-2.0
// Which pixels of an X-ray show a CT that holds one body of many, such as a segmented bone.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "image/image2d.h"

namespace af::registration {

/// Pixels (1: used, row-major) of the silhouette of a DRR, which is where it has more than 1/50 of
/// its largest value, grown by `margin_px` to every side, less the discs of radius `margin_px`
/// about `cuts_px` (column, row): where the CT ends but the body goes on, a DRR has an edge that no
/// X-ray has. All 0 for a DRR that is 0. \test Silhouette.IsGrownAndLeavesOutCuts
std::vector<std::uint8_t> silhouette(const Image2d& drr,
                                     double margin_px,
                                     std::span<const Eigen::Vector2d> cuts_px);

/// The smallest region that holds all used pixels and `border` pixels around them, cut at the
/// image's edges; empty when none is used.
RegionOfInterest region_of(std::span<const std::uint8_t> used, int width, int height, int border);

}  // namespace af::registration
