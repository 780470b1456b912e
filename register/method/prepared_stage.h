// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "register/method/registration_options.h"
#include "register/optimizer/optimizer.h"
#include "register/problem/multi_view_objective.h"
#include "register/problem/registration_problem.h"
#include "register/problem/silhouette.h"

namespace af::registration {

/// How a stage of a registration sees a detector.
struct StageGrid {
  int pixel_step = 1;      ///< a stage pixel is the mean of pixel_step x pixel_step detector pixels
  double roi_scale = 1.0;  ///< sides of the region relative to the view's, about its centre
  double blur_sigma_px = 0.0;  ///< of the X-ray, in detector pixels, including the mean's own blur

  bool operator==(const StageGrid&) const = default;
};

/// The view of a stage: the region, scaled about its centre and cut at the detector's edges, with
/// stage pixels of pixel_step detector pixels (View::coarser). It never reaches beyond the
/// detector, so a field made for the detector holds every ray.
View stage_view(const View& view, const StageGrid& grid);

/// The X-ray of a whole detector as the DRRs of stage_view(view, grid) see it: block means, blurred
/// in all by blur_sigma_px. It is cropped to the region last, so that its edge pixels include their
/// surroundings. A stage pixel is used when its whole block is (`mask`: whole detector, non-zero =
/// used; empty: all). drr_range is left at its default.
SimilarityReference stage_reference(const Image2d& xray,
                                    const Image2d& mask,
                                    const View& view,
                                    const StageGrid& grid);

class SeenView;

/// A stage of a chain: X-rays and regions as it sees them, its renderers and measures. The problem
/// must outlive it. Call place_at() before a search: what the objective compares depends on that
/// pose alone.
struct PreparedStage {
  StageOptions options;
  const Optimizer* optimizer;
  std::vector<std::shared_ptr<SeenView>> views;
  std::vector<RegionOfInterest> regions;  ///< where it looks, before roi_scale
  MultiViewObjective objective;  ///< narrowed to the silhouettes at the last pose, if there are any
  std::vector<SilhouetteView> silhouettes;  ///< empty where the whole region counts

  /// Whether place_at() would change what the objective compares.
  [[nodiscard]] bool would_move(const RegistrationProblem& problem,
                                const RigidTransform& room_from_ct) const;
  /// Prepares the objective for a pose: puts the regions where the target is seen there
  /// (region_at(), by whole stage pixels), then calls narrow_to(). Returns false, with the regions
  /// where they were, when X-rays show nothing to compare there.
  /// \test PreparedStage.IsTheSameAgainWhereverItHasBeen
  [[nodiscard]] bool place_at(const RegistrationProblem& problem,
                              const RigidTransform& room_from_ct);
  /// Narrows the objective to the silhouettes at a pose, if the stage uses silhouettes. False when
  /// too little of them is visible.
  [[nodiscard]] bool narrow_to(const RegistrationProblem& problem,
                               const RigidTransform& room_from_ct);
  /// The objective's value at a pose, placed there. Inadmissible where it cannot be placed.
  [[nodiscard]] ObjectiveValue value_at(const RegistrationProblem& problem,
                                        const RigidTransform& room_from_ct);
  /// The same with the regions where they are, within the silhouettes at the pose.
  [[nodiscard]] ObjectiveValue value_in_place(const RegistrationProblem& problem,
                                              const RigidTransform& room_from_ct);
};

/// RegistrationView::drr_range of a view. Throws InputError when its field does not hold the
/// nominal pose.
ValueRange drr_range_of(const RegistrationProblem& problem, const RegistrationView& view);

/// The stages of a method, over some of the problem's views, placed at the nominal pose. Throws
/// InputError when the problem has problems or lacks their levels, when an X-ray has nothing to
/// compare there, and as drr_range_of() does.
std::vector<PreparedStage> prepared_stages(const RegistrationProblem& problem,
                                           std::span<const RegistrationView> views,
                                           std::span<const StageOptions> stages,
                                           const std::shared_ptr<ThreadPool>& threads);

/// The view's ray casting at a level. None if the problem has none.
std::shared_ptr<const DrrRenderer> ray_cast_of(const RegistrationView& view, int level);

/// A stage that casts rays instead of looking up. It still stays inside the fields' ranges.
MultiViewObjective ray_cast_objective(const RegistrationProblem& problem,
                                      const PreparedStage& stage);

}  // namespace af::registration
