// SPDX-License-Identifier: Apache-2.0
// Finished registration runs, as commands that compare them read them.
#pragma once

#include <functional>
#include <map>
#include <string>

#include "evaluate/registration/registration_rows.h"
#include "evaluate/report/evaluation_run.h"
#include "geometry/ct_box.h"
#include "geometry/rigid_transform.h"

namespace af::evaluation {

/// A case as its run's summary states it.
struct FinishedCase {
  PoseFrame gold_frame;  ///< what the poses of its rows are relative to
  CtBox target_box_ct;   ///< over which distances are averaged
  bool has_one_view;
};

/// What is needed to read a run's rows.
struct RunFacts {
  std::string summary_path;
  double success_tre_mm = 0.0;
  std::map<std::string, FinishedCase> cases;

  /// Throws FileError when the summary has no such case.
  [[nodiscard]] const FinishedCase& case_of(const RegistrationRow& row) const;
};

/// Throws FileError when the summary does not state them.
RunFacts facts_of(const EvaluationRun& run);

/// Calls `receive` with the rows of registrations.csv in order. They have case, renderer, start
/// index, poses, TREs, mRPD, one view's depth, error of the rotation, DRRs and seconds; the rest is
/// as in a row without a registration. `facts`: those of the run. Throws FileError when one of
/// these is missing or no number.
void read_rows(const EvaluationRun& run,
               const RunFacts& facts,
               const std::function<void(const RegistrationRow& row)>& receive);

}  // namespace af::evaluation
