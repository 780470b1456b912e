// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "evaluate/report/evaluation_run.h"
#include "evaluate/report/run_report.h"

namespace af::evaluation {

/// What was found, in plain words and as tiles of key numbers; HTML.
std::string summary_section(const std::vector<EvaluationRun>& runs);

/// Several registration runs in one table and one figure, which is drawn into `figures`; HTML.
std::string comparison_section(const std::vector<EvaluationRun>& runs,
                               const std::filesystem::path& figures);

/// Success, TRE, failures and overlays of one registration run; HTML.
std::string registration_section(const EvaluationRun& run, const std::string& title);

/// The failed starts of a registration run with what became of them; HTML.
std::string failures_text(const EvaluationRun& run);

/// PSNR of all image quality runs beside the paper's, box plot, worst pairs; HTML, empty without
/// such runs. The box plot of several runs is drawn into `figures`.
std::string image_quality_section(const std::vector<EvaluationRun>& runs,
                                  const std::filesystem::path& figures);

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

/// How every run can be repeated; HTML.
std::string provenance_section(const std::vector<EvaluationRun>& runs);

}  // namespace af::evaluation
