// SPDX-License-Identifier: Apache-2.0
#include "evaluate/report/report_page.h"

#include <set>
#include <string_view>

#include "base/build_info.h"
#include "base/error.h"
#include "base/joined.h"
#include "evaluate/report/html_text.h"
#include "evaluate/report/report_style.h"
#include "evaluate/report/sections_report.h"

namespace af::evaluation {
namespace {

using nlohmann::json;

/// "Registration of skull", or another title that fits the runs.
std::string default_title(const std::vector<EvaluationRun>& runs) {
  const auto is_only = [&](const char* kind) { return runs_of(runs, kind).size() == runs.size(); };
  if (is_only("error-budget")) return "Error budget of registrations";
  if (is_only("similarity-curves")) return "Shape of the similarity";
  std::set<std::string> cases;
  for (const EvaluationRun* run : runs_of(runs, "registration"))
    for (const json& entry : run->summary.at("cases"))
      cases.insert(entry.at("case").get<std::string>());
  if (cases.empty()) return "Image quality of attenuation fields";
  if (cases.size() > 4) return "Registration of " + std::to_string(cases.size()) + " cases";
  return "Registration of " + joined(cases);
}

std::string header(const std::vector<EvaluationRun>& runs, const std::string& title) {
  const std::string started =
      runs.front().summary.at("provenance").value("started_utc", "").substr(0, 10);
  return element("header",
                 element("p", "Attenuation fields · evaluation report", "eyebrow") +
                     element("h1", escaped(title)) +
                     element("p",
                             "af-evaluate " + escaped(program_version()) + " · run on " +
                                 escaped(started) + " · <a href=\"#provenance\">provenance</a>",
                             "quiet"));
}

/// Links to the sections of a page, from their headings.
std::string contents(const std::string& sections) {
  constexpr std::string_view kOpening = "<h2 id=\"";
  std::string items;
  for (std::size_t at = sections.find(kOpening); at != std::string::npos;
       at = sections.find(kOpening, at + 1)) {
    const std::size_t id = at + kOpening.size();
    const std::size_t id_end = sections.find('"', id);
    const std::size_t text = sections.find('>', id_end) + 1;
    items += element("li",
                     "<a href=\"#" + sections.substr(id, id_end - id) + "\">" +
                         sections.substr(text, sections.find("</h2>", text) - text) + "</a>");
  }
  return "<nav aria-label=\"Contents\">" + element("ul", items) + "</nav>\n";
}

}  // namespace

std::string report_page(std::vector<EvaluationRun> runs,
                        const std::filesystem::path& output,
                        const std::string& title) try {
  const std::filesystem::path page = std::filesystem::weakly_canonical(output);
  const std::filesystem::path figures = page.parent_path() / (page.stem().string() + "-figures");
  for (EvaluationRun& run : runs) run.page_folder = page.parent_path();
  const std::string heading = title.empty() ? default_title(runs) : title;
  const auto registrations = runs_of(runs, "registration");
  std::string sections = comparison_section(runs, figures);
  for (const EvaluationRun* run : registrations)
    sections += registration_section(
        *run, registrations.size() == 1 ? "Registration accuracy" : "Registration: " + run->name);
  sections += error_budget_section(runs) + similarity_section(runs) +
              image_quality_section(runs, figures) + field_parameters_section(runs) +
              xray_section(runs) + definitions_section() + provenance_section(runs);
  const std::string footer =
      element("footer",
              "Made by af-evaluate " + escaped(program_version()) +
                  ". Research software, not a medical device. This file holds everything it shows "
                  "and opens without a network; links lead to files beside it.");
  return "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
         "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n" +
         element("title", escaped(heading)) + element("style", report_style()) +
         "</head>\n<body>\n" +
         element("main",
                 header(runs, heading) + summary_section(runs) + contents(sections) + sections +
                     footer) +
         element("script", report_script()) + "</body>\n</html>\n";
} catch (const json::exception& error) {
  throw FileError("summary.json of a run", std::string("lacks something: ") + error.what());
} catch (const std::filesystem::filesystem_error& error) {
  throw FileError(output.string(), error.what());
}

}  // namespace af::evaluation
