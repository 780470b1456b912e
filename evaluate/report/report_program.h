// SPDX-License-Identifier: Apache-2.0
// af-report (python/af-report) turns results into what people read: figures, tables, pages.
#pragma once

#include <string>
#include <vector>

#include "ranks/communicator.h"

namespace af::evaluation {

/// Rank 0. Runs af-report, which is beside this program or in PATH. Its standard output is ours.
/// When it ends with 3, throws InputError with its message. When it cannot be run or ends
/// otherwise, throws FileError.
void run_af_report(const std::vector<std::string>& arguments);

/// Rank 0, when all numbers are written. Makes the figures and tables beside them. Where af-report
/// cannot, because Python or a module of it is missing, a warning names the command for later.
/// \test EvaluateProgram.ComputesWithoutPythonAndNamesTheCommandForFigures
void draw_results(const std::vector<std::string>& arguments, const Communicator& world);

}  // namespace af::evaluation
