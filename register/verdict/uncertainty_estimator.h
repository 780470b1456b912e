// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <span>
#include <string>

#include "base/described_fields.h"
#include "base/thread_pool.h"
#include "register/method/prepared_stage.h"
#include "register/method/registration_result.h"
#include "register/verdict/uncertainty_report.h"
#include "register/verdict/verdict.h"

namespace af::registration {

struct UncertaintyOptions {
  bool is_left_out = false;           ///< all but the confidence
  double calibration_error_px = 0.0;  ///< per axis and view

  void describe(Fields& field);
};

/// Says how far the end of a registration may be from the truth (docs/uncertainty.md): the sandwich
/// covariance of the stage that it ended with, widened by a factor calibrated on measured
/// registrations, what the cameras' calibration and the DRRs' interpolation add, the resulting TRE,
/// and the confidence that it succeeded. Where the stage's measure has no derivative (tncc, gd, pi,
/// entropy, go), rg stands for it, within silhouettes gc. For one thread at a time. \test
/// UncertaintyEstimator.ForetellsTheSpreadOfNoisyXrays \test
/// UncertaintyEstimator.AddsWhatInterpolationShifts
class UncertaintyEstimator {
 public:
  /// `problem` and `method`: of the registration. Reports have only a confidence when uncertainty
  /// is left out, and when X-rays have no gradients to measure the curvature.
  UncertaintyEstimator(std::shared_ptr<const RegistrationProblem> problem,
                       const RegistrationOptions& method,
                       const UncertaintyOptions& options,
                       const std::shared_ptr<ThreadPool>& pool = nullptr);

  /// `view_values`: of PoseExaminer, with backgrounds, at the result's end. Covariance and TREs are
  /// NaN when there is no end, when some motion from it is admissible to neither side, when too
  /// little of a silhouette is visible or X-rays show nothing there, and when values within
  /// silhouettes are of a stage that looks at the region, or the other way round; the confidence is
  /// 0 where failure_of() says why there is no end.
  [[nodiscard]] UncertaintyReport report(const RegistrationResult& result,
                                         std::span<const ViewValue> view_values);

 private:
  /// Returns the rms TRE (mm) that the sandwich alone predicts, for the confidence, to which flat
  /// directions count in full; NaN where there is none.
  double add_covariance(const RegistrationResult& result,
                        std::span<const ViewValue> view_values,
                        UncertaintyReport& report);

  /// Standard deviations of what shifts the views' images, mm at the isocentre, at a level.
  [[nodiscard]] std::vector<Eigen::Vector2d> shifts_mm(int level) const;

  std::shared_ptr<const RegistrationProblem> problem_;
  UncertaintyOptions options_;
  std::map<std::string, std::size_t> stage_of_chain_;
  std::vector<std::string> similarities_;  ///< of the stages, as registered with
  std::vector<PreparedStage> ends_;        ///< one for every way to end; none: no covariance
};

}  // namespace af::registration
