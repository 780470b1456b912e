// SPDX-License-Identifier: Apache-2.0
// Finished registration runs side by side: one row per run, case and renderer.
#pragma once

#include <vector>

#include "evaluate/report/evaluation_run.h"
#include "files/csv_table.h"

namespace af::evaluation {

/// A row for every case and renderer of all registration runs, by run. Throws FileError when a
/// run's table or summary lacks something, InputError when no run has a row. Columns:
/// - run (its folder's name), case, method ("PRESET SIMILARITY OPTIMIZER[ corrected]", or the name
/// of
///   other programs' poses, whose other three are empty), preset, similarity, optimizer,
///   renderer, starts;
/// - for starts 0 to 8, 8 to 16 and 16 to 30 mm from gold: their number, the successes, Wilson's
///   interval of their rate, and the mean rotation_share() of the starts, NaN without starts;
/// - error, by which ends are counted (RegistrationRow::decisive_name()); for successes its mean
/// and
///   median, for one view the median and the 95th percentile of the error in depth, the length of
///   the mean signed rotation and translation, and the median rotation;
/// - gross_failures over all starts (an error of 10 mm or more, or no pose);
/// - the case's own capture range, "at least 16" where the study ends first, "-" where no start
///   lies in an interval; medians over all starts of DRRs and seconds.
CsvTable methods_table(const std::vector<EvaluationRun>& runs);

/// Field against ray casting from the same starts, a row per run that has both: success, the
/// distance between the two end poses with intervals over patients, and what may be claimed from
/// it. Where a test was not made for want of pairs, it says so in place of p.
CsvTable pairs_table(const std::vector<EvaluationRun>& runs);

}  // namespace af::evaluation
