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
  bool is_left_out = false;           ///< everything but the confidence
  double calibration_error_px = 0.0;  ///< per axis and view

  void describe(Fields& field);
};

/// Says how far the end of a registration may be from the truth (docs/uncertainty.md). It takes the
/// sandwich covariance of the stage that the registration ended with, widened by a factor
/// calibrated on measured registrations. It adds what the cameras' calibration and the DRRs'
/// interpolation contribute, and derives the TRE and the confidence of success. Where the stage's
/// measure has no derivative (tncc, gd, pi, entropy, go), rg replaces it, or gc within silhouettes.
/// For one thread at a time. \test UncertaintyEstimator.ForetellsTheSpreadOfNoisyXrays \test
/// UncertaintyEstimator.AddsWhatInterpolationShifts
class UncertaintyEstimator {
 public:
  /// `problem` and `method`: those of the registration. Reports have only a confidence when
  /// uncertainty is left out, and when X-rays have no gradients to measure the curvature.
  UncertaintyEstimator(std::shared_ptr<const RegistrationProblem> problem,
                       const RegistrationOptions& method,
                       const UncertaintyOptions& options,
                       const std::shared_ptr<ThreadPool>& pool = nullptr);

  /// `view_values`: those of PoseExaminer, with backgrounds, at the result's end. Covariance and
  /// TREs are NaN when there is no end, when some motion from it is inadmissible to both sides, and
  /// when too little of a silhouette is visible or X-rays show nothing there. They are also NaN
  /// when values within silhouettes belong to a stage that looks at the region, or vice versa. The
  /// confidence is 0 where failure_of() says why there is no end.
  [[nodiscard]] UncertaintyReport report(const RegistrationResult& result,
                                         std::span<const ViewValue> view_values);

 private:
  /// Returns the rms TRE (mm) that the sandwich alone predicts, for the confidence. Flat directions
  /// count in full in it. NaN where there is none.
  double add_covariance(const RegistrationResult& result,
                        std::span<const ViewValue> view_values,
                        UncertaintyReport& report);

  /// Standard deviations (mm at the isocentre) of what shifts the views' images at a level.
  [[nodiscard]] std::vector<Eigen::Vector2d> shifts_mm(int level) const;

  std::shared_ptr<const RegistrationProblem> problem_;
  UncertaintyOptions options_;
  std::map<std::string, std::size_t> stage_of_chain_;
  std::vector<std::string> similarities_;  ///< one per stage, as registered with
  std::vector<PreparedStage> ends_;        ///< one for every way to end; empty: no covariance
};

}  // namespace af::registration
