// SPDX-License-Identifier: Apache-2.0
// What the sections of the page have in common.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "evaluate/report/evaluation_run.h"

namespace af::evaluation {

/// Runs of one kind, in order.
std::vector<const EvaluationRun*> runs_of(const std::vector<EvaluationRun>& runs,
                                          const std::string& kind);

/// Whether every case of a registration run has one view: its ends are right by mRPD then, as one
/// view shows no depth. false where the run does not say.
bool is_of_one_view(const nlohmann::json& summary);

/// "attenuation fields" or "ray casting" for our own renderers, else the method's name; text.
std::string method_name(const nlohmann::json& renderer);

/// The same as HTML.
std::string method_title(const nlohmann::json& renderer);

/// The field of an image quality run: "camera A", with several studies "camera A of skull"; text.
std::string field_name(const EvaluationRun& run);

/// A heading of the page that its table of contents leads to; `text` is HTML.
std::string section_heading(const std::string& text, const std::string& id);

/// The id of a run's section: "registration-3".
std::string run_id(const EvaluationRun& run);

/// A figure of a run, NAME.svg of its folder, with links to the files of that name beside it (PNG,
/// CSV).
std::string run_figure(const EvaluationRun& run,
                       const std::string& name,
                       std::string_view alternative,
                       std::string_view caption,
                       std::string_view css_class = "");

/// The same for one that the report itself drew: `path` is without extension, `page_folder` the
/// page's.
std::string report_figure(const std::filesystem::path& path,
                          const std::filesystem::path& page_folder,
                          std::string_view alternative,
                          std::string_view caption,
                          std::string_view css_class = "");

}  // namespace af::evaluation
