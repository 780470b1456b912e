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

/// A stage of a chain with all that does not depend on where it starts: X-rays and regions as it
/// sees them, its renderers and measures.
struct PreparedStage {
  StageOptions options;
  const Optimizer* optimizer;
  MultiViewObjective objective;  ///< narrowed to the silhouettes at the last pose, if any
  std::vector<SilhouetteView> silhouettes;  ///< none where the whole region counts

  /// Narrows the objective to the silhouettes at a pose, if the stage uses silhouettes; false when
  /// too little of them is visible.
  [[nodiscard]] bool narrow_to(const RegistrationProblem& problem,
                               const RigidTransform& room_from_ct);
};

/// Smallest and largest value of each view's DRR at the nominal pose, over the region grown by half
/// its size to every side. InputError when the fields do not hold that pose.
std::vector<ValueRange> drr_ranges_at_nominal(const RegistrationProblem& problem);

/// `drr_ranges`: of the views. InputError when an X-ray has nothing that could be compared.
PreparedStage prepared_stage(const RegistrationProblem& problem,
                             const StageOptions& stage,
                             std::span<const ValueRange> drr_ranges,
                             const std::shared_ptr<ThreadPool>& pool);

/// The view's ray casting at a level; none where the problem has none.
std::shared_ptr<const DrrRenderer> ray_cast_of(const RegistrationView& view, int level);

/// A stage with ray casting in place of look-up, inside the fields' ranges all the same.
MultiViewObjective ray_cast_objective(const RegistrationProblem& problem,
                                      const PreparedStage& stage);

}  // namespace af::registration
