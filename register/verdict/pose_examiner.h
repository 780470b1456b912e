// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "register/method/prepared_stage.h"
#include "register/verdict/verdict.h"

namespace af::registration {

/// Judges poses view by view, independently of the method that found them. It uses the judge of
/// portfolios (RobustGradient) at level 0 and at the judge's own level, or the coarsest that the
/// views have. For silhouettes see ViewValue. For one thread at a time.
/// \test PoseExaminer.TellsARightPoseFromAWrongOneInEveryView
class PoseExaminer {
 public:
  /// The level of the image pyramids that it looks at, if views have it.
  static int coarsest_level();

  /// `problem`: that of the registration. `silhouette_mm`: the margin around the CT's silhouette
  /// within which poses are judged, by gradient correlation (RegistrationOptions::silhouette_mm()).
  /// 0: over twice the region.
  PoseExaminer(std::shared_ptr<const RegistrationProblem> problem, double silhouette_mm);

  /// One value per view. NaN where the pose is outside a field, or the X-ray has no gradients to
  /// explain. `with_backgrounds` also computes what the X-ray has in common with the CT wherever
  /// that is. This is the mean of `fine` over the poses beside this one that the view's field
  /// holds: four with the CT moved by kBackgroundDistanceMm to both sides along the view's columns
  /// and rows. If it holds none of them, they are moved by half or a quarter of that. \test
  /// PoseExaminer.BackgroundIsFarBelowARightPose
  [[nodiscard]] std::vector<ViewValue> view_values(const RigidTransform& room_from_ct,
                                                   bool with_backgrounds = false);

 private:
  struct JudgedView {
    CameraGeometry camera;
    std::vector<PreparedStage> stages;  ///< coarse and fine, which are only evaluated
  };
  static std::optional<JudgedView> judged_view(const RegistrationProblem& problem,
                                               std::size_t view,
                                               double silhouette_mm);
  /// The share of the X-ray's gradients that a pose explains, from a stage's value. Within
  /// silhouettes this is a squared correlation.
  [[nodiscard]] double share_of(const ObjectiveValue& value) const;
  /// Mean share in detail over four poses `mm` beside one: those that the field holds, and in whose
  /// region the view has been judged. NaN for none.
  [[nodiscard]] double share_beside(const RigidTransform& room_from_ct,
                                    double mm,
                                    JudgedView& view) const;

  std::shared_ptr<const RegistrationProblem> problem_;
  bool in_silhouette_ = false;
  std::vector<std::optional<JudgedView>> views_;  ///< none where nothing can be judged
};

/// The farther this was, the better failures were told from successes (docs/uncertainty.md, on 2 to
/// 16 mm). It lies within the default fields' range.
inline constexpr double kBackgroundDistanceMm = 20.0;

}  // namespace af::registration
