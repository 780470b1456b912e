// SPDX-License-Identifier: Apache-2.0
#include "evaluate/report/run_report.h"

#include <algorithm>

#include "evaluate/report/html_text.h"
#include "files/output_file.h"

namespace af::evaluation {

using nlohmann::json;

std::vector<const EvaluationRun*> runs_of(const std::vector<EvaluationRun>& runs,
                                          const std::string& kind) {
  std::vector<const EvaluationRun*> result;
  for (const EvaluationRun& run : runs)
    if (run.kind == kind) result.push_back(&run);
  return result;
}

bool is_of_one_view(const json& summary) {
  const json cases = summary.value("cases", json::array());
  return !cases.empty() && std::all_of(cases.begin(), cases.end(), [](const json& of_case) {
    return of_case.value("views", json()) == 1;
  });
}

std::string method_name(const json& renderer) {
  const std::string name = renderer.at("renderer").get<std::string>();
  return name == "field" ? "attenuation fields" : name == "raycast" ? "ray casting" : name;
}

std::string method_title(const json& renderer) {
  return escaped(method_name(renderer));
}

std::string field_name(const EvaluationRun& run) {
  const std::string camera = run.summary.at("field").at("camera").get<std::string>();
  if (run.summary.contains("case")) return run.summary.at("case").get<std::string>() + " " + camera;
  const std::string study = std::filesystem::path(run.name).parent_path().generic_string();
  return "camera " + camera + (study.empty() ? "" : " of " + study);
}

std::string section_heading(const std::string& text, const std::string& id) {
  return "<h2 id=\"" + escaped(id) + "\">" + text + "</h2>\n";
}

std::string run_id(const EvaluationRun& run) {
  return "run-" + escaped(file_name_part(run.name));
}

namespace {

std::string figure_with_links(const std::string& svg,
                              const std::filesystem::path& path,
                              const std::filesystem::path& page_folder,
                              std::string_view alternative,
                              std::string_view caption,
                              std::string_view css_class) {
  std::string links;
  for (const char* extension : {"png", "csv"}) {
    const std::filesystem::path file = path.string() + "." + extension;
    if (!std::filesystem::exists(file)) continue;
    const std::string url = url_of(file.lexically_proximate(page_folder).generic_string());
    links +=
        " <a href=\"" + url + "\">" + (extension == std::string("png") ? "PNG" : "CSV") + "</a>";
  }
  return figure(svg,
                "image/svg+xml",
                alternative,
                std::string(caption) + element("span", links, "files"),
                css_class);
}

}  // namespace

std::string report_figure(const std::filesystem::path& path,
                          const std::filesystem::path& page_folder,
                          std::string_view alternative,
                          std::string_view caption,
                          std::string_view css_class) {
  return figure_with_links(
      read_text_file(path.string() + ".svg"), path, page_folder, alternative, caption, css_class);
}

std::string run_figure(const EvaluationRun& run,
                       const std::string& name,
                       std::string_view alternative,
                       std::string_view caption,
                       std::string_view css_class) {
  return figure_with_links(
      run.file(name + ".svg"), run.folder / name, run.page_folder, alternative, caption, css_class);
}

}  // namespace af::evaluation
