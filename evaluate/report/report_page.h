// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "evaluate/report/evaluation_run.h"

namespace af::evaluation {

/// The whole page, self-contained: style, figures and pictures are part of it. Figures that join
/// several runs are also left beside it, in `output`'s name with "-figures" for its extension.
/// FileError: a run lacks something, or names a file that is not its own.
std::string report_page(std::vector<EvaluationRun> runs,
                        const std::filesystem::path& output,
                        const std::string& title);

}  // namespace af::evaluation
