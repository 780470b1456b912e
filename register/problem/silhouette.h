// SPDX-License-Identifier: Apache-2.0
// Which pixels of an X-ray show a CT that holds only one of many bodies, such as a segmented bone.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "base/thread_pool.h"
#include "register/problem/multi_view_objective.h"
#include "register/problem/registration_problem.h"
#include "xray/image2d.h"

namespace af::registration {

/// Pixels (1: used, row-major) of the silhouette of a DRR. The silhouette is where the DRR has more
/// than 1/50 of its largest value, grown by `margin_px` to every side. Discs of radius `margin_px`
/// about `cuts_px` (column, row) are left out: where the CT ends but the body goes on, a DRR has an
/// edge that no X-ray has. All 0 for a DRR that is 0. \test Silhouette.IsGrownAndLeavesOutCuts
std::vector<std::uint8_t> silhouette(const Image2d& drr,
                                     double margin_px,
                                     std::span<const Eigen::Vector2d> cuts_px);

/// The smallest region that holds all used pixels and `border` pixels around them, cut at the
/// image's edges. Empty when none is used.
RegionOfInterest region_of(std::span<const std::uint8_t> used, int width, int height, int border);

/// A view of a stage whose region is not yet narrowed to a silhouette.
struct SilhouetteView {
  ObjectiveView whole;            ///< over the stage's region
  SimilarityReference reference;  ///< over the same
  SimilarityOptions similarity;
  std::shared_ptr<const DrrRenderer> sharpest;  ///< of the problem's view; it draws the silhouette
  double margin_px = 0.0;                       ///< in stage pixels
};

/// The objective that compares only what lies within the silhouettes of the CT at a pose, grown by
/// the views' margins. A measure over the whole region would mostly compare what surrounds a bone
/// and is not in its CT. Renderers look only at the silhouettes' boxes. The silhouettes stay where
/// they are when poses change. None when a view sees fewer than kLeastSilhouettePixels of them, or
/// no contrast there. \test SilhouetteObjective.ComparesOnlyWhatIsNearTheBody
std::optional<MultiViewObjective> silhouette_objective(
    std::span<const SilhouetteView> views,
    std::span<const Eigen::Vector3d> cut_points_ct,
    const RigidTransform& room_from_ct,
    const std::shared_ptr<ThreadPool>& pool);

/// Fewer stage pixels than this cannot determine six parameters.
inline constexpr std::size_t kLeastSilhouettePixels = 64;

}  // namespace af::registration
