// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "register/method/registration.h"
#include "register/verdict/verdict.h"

namespace af::registration {

/// Judges poses view by view, independently of the method that found them, with the judge of
/// portfolios (RobustGradient) at level 0 and at the judge's own level, or the coarsest that the
/// views have. For silhouettes see ViewValue. For one thread at a time.
/// \test PoseExaminer.TellsARightPoseFromAWrongOneInEveryView
class PoseExaminer {
 public:
  /// The level of the image pyramids that it looks at where views have it.
  static int coarsest_level();

  /// `problem`: as for a RegistrationRunner. `silhouette_mm`: the margin about the CT's silhouette
  /// within which poses are judged, by gradient correlation
  /// (RegistrationOptions::silhouette_mm()); 0: over twice the region.
  PoseExaminer(const RegistrationProblem& problem, double silhouette_mm);

  /// One per view; NaN where the pose is outside a field, or the X-ray has no gradients to explain.
  [[nodiscard]] std::vector<ViewValue> view_values(const RigidTransform& room_from_ct);

 private:
  bool in_silhouette_ = false;
  std::vector<std::unique_ptr<RegistrationRunner>> views_;  ///< none where nothing can be judged
};

}  // namespace af::registration
