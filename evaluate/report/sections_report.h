// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "evaluate/report/evaluation_run_files.h"

namespace af::evaluation {

/// Runs of one kind, in order.
std::vector<const EvaluationRun*> runs_of(const std::vector<EvaluationRun>& runs,
                                          const std::string& kind);

/// What was found, in plain words and as tiles of key numbers; HTML.
std::string summary_section(const std::vector<EvaluationRun>& runs);

/// Success, TRE, failures and overlays of one registration run; HTML.
std::string registration_section(const EvaluationRun& run);

/// PSNR of all image quality runs beside the paper's, box plot, worst pairs; HTML, empty without
/// such runs.
std::string image_quality_section(const std::vector<EvaluationRun>& runs);

/// Similarity along each pose parameter of all similarity-curves runs; HTML, empty without such
/// runs.
std::string similarity_section(const std::vector<EvaluationRun>& runs);

/// Image quality and cost of fields against their parameters; HTML, empty without such runs.
std::string field_parameters_section(const std::vector<EvaluationRun>& runs);

/// What each part of the chain from CT to pose adds to the error; HTML, empty without such runs.
std::string error_budget_section(const std::vector<EvaluationRun>& runs);

/// How the X-rays of the registration runs were made; HTML.
std::string xray_section(const std::vector<EvaluationRun>& runs);

/// What the words mean; HTML.
std::string definitions_section();

/// How every run can be repeated; `report` is where the page will be, for links. HTML.
std::string provenance_section(const std::vector<EvaluationRun>& runs,
                               const std::filesystem::path& report);

}  // namespace af::evaluation
