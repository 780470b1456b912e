// SPDX-License-Identifier: Apache-2.0
// Finished registration runs side by side: one row per run, case and renderer.
#pragma once

#include <string>
#include <vector>

#include "evaluate/report/evaluation_run.h"
#include "evaluate/statistics/success_rate.h"
#include "text/csv_table.h"

namespace af::evaluation {

/// What one method did on one case of one run.
struct MethodRow {
  std::string run;  ///< its folder's name
  std::string case_name;
  std::string
      method;  ///< "PRESET SIMILARITY OPTIMIZER[ corrected]", or the name of other programs' poses
  std::string preset, similarity, optimizer;  ///< the parts of it; empty for other programs' poses
  std::string renderer;
  std::vector<IntervalSuccess> bands;  ///< of initial TRE, see kBandEndsMm
  /// Per band the mean rotation_share() of the starts; NaN where a run does not state its target.
  std::vector<double> rotation_shares;
  std::int64_t starts = 0;
  double mean_tre_mm = 0.0;  ///< of successes, as the rest
  double median_tre_mm = 0.0;
  double rotation_bias_deg = 0.0;    ///< length of the mean signed rotation
  double translation_bias_mm = 0.0;  ///< length of the mean signed translation
  double median_rotation_error_deg = 0.0;
  std::int64_t gross_failures = 0;  ///< of all starts: a TRE of 10 mm or more, or no pose
  /// Of all starts, an mRPD below the threshold: to be read with one view, which shows no depth.
  std::int64_t mrpd_successes = 0;
  double median_mrpd_mm = 0.0;  ///< of these
  /// The case's own capture range as text, "at least 16" where the study ends first; "-" where the
  /// run's summary does not have it.
  std::string capture_range_mm = "-";
  double median_drr_count = 0.0;  ///< of all starts, as the seconds
  double median_seconds = 0.0;
};

/// Bands of initial TRE: 0 to 8, 8 to 16, 16 to 30 mm.
inline constexpr double kBandEndsMm[] = {0.0, 8.0, 16.0, 30.0};

/// Rows of all registration runs, by run, case and renderer. FileError when a run's table or
/// summary lacks something.
std::vector<MethodRow> method_rows(const std::vector<EvaluationRun>& runs);

/// With Wilson intervals and counts.
CsvTable methods_table(const std::vector<MethodRow>& rows);

/// Field against ray casting from the same starts, a row per run that has both: success, the
/// distance between the two end poses with intervals over patients, and what is claimed of it.
CsvTable pairs_table(const std::vector<EvaluationRun>& runs);

}  // namespace af::evaluation
