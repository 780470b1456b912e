// SPDX-License-Identifier: Apache-2.0
#include "base/joined.h"
#include "evaluate/outputs/sample_summary_json.h"
#include "evaluate/report/html_text.h"
#include "evaluate/report/number_html.h"
#include "evaluate/report/sections_report.h"

namespace af::evaluation {

using nlohmann::json;

namespace {

std::string maxima_table(const json& summary) {
  std::vector<HtmlTable::Column> columns = {{"Parameter", false}};
  for (const json& renderer : summary.at("renderers")) {
    const std::string name = renderer.at("renderer") == "field" ? "field" : "ray casting";
    columns.push_back({name + ": maximum at", true});
    columns.push_back({"width", true});
    columns.push_back({"width at the target (mm)", true});
  }
  HtmlTable table(columns,
                  "Where the similarity is highest, relative to the gold pose, and how broad it is "
                  "at half height above the lowest value of all six curves");
  const std::size_t count = summary.at("renderers").at(0).at("maxima").size();
  for (std::size_t i = 0; i < count; ++i) {
    const json& first = summary.at("renderers").at(0).at("maxima").at(i);
    const std::string unit = escaped(first.at("unit").get<std::string>());
    std::vector<std::string> cells = {escaped(first.at("parameter").get<std::string>())};
    for (const json& renderer : summary.at("renderers")) {
      const json& peak = renderer.at("maxima").at(i);
      cells.push_back((peak.at("is_at_edge").get<bool>() ? "beyond " : "") +
                      decimals(peak.at("offset"), 2) + " " + unit);
      cells.push_back(peak.at("width").is_number() ? decimals(peak.at("width"), 2) + " " + unit
                                                   : "wider than shown");
      cells.push_back(decimals(peak.at("width_mm_at_target"), 2));
    }
    table.add_row(cells);
  }
  return table.html();
}

std::string broadest_text(const json& summary) {
  std::string text;
  for (const json& renderer : summary.at("renderers")) {
    const std::string axis = escaped(renderer.at("broadest_rotation").get<std::string>());
    text +=
        std::string(renderer.at("renderer") == "field" ? "With the field" : "With ray casting") +
        (axis.empty() ? " no rotation stands out as broadest. "
                      : " the broadest rotation is " + axis + ". ");
  }
  return element("p",
                 text +
                     "The paper finds the rotation about the patient's cranial-caudal axis, rz in "
                     "this project's room frame, typically the broadest.");
}

/// The paper's Fig. 9, when the sweep has DRRs near its levels.
std::string difference_text(const EvaluationRun& run) {
  const json images = run.summary.value("difference_images", json());
  if (!images.is_object()) return "";
  const std::string levels = joined(images.at("images"), ", ", [](const json& image) {
    return decimals(image.at("psnr_db"), 1);
  });
  return figure(run.file(images.at("file").get<std::string>()),
                "image/png",
                "a field DRR and difference images",
                "<b>What a PSNR looks like</b> (the paper's Fig. 9): field less ray cast at " +
                    levels + " dB, " + escaped(images.at("target").get<std::string>()) +
                    ", all at one pose and in one window.",
                "picture wide");
}

}  // namespace

std::string similarity_section(const std::vector<EvaluationRun>& runs) {
  std::string text;
  for (const EvaluationRun* run : runs_of(runs, "similarity-curves"))
    text +=
        element("h3", "Case " + escaped(run->summary.at("case").get<std::string>())) +
        run_figure(*run,
                   "similarity-curves",
                   "Similarity along each pose parameter",
                   "<b>Similarity about the gold pose</b> (the paper's Fig. 14): one parameter at "
                   "a time; the marks are the maxima.",
                   "wide") +
        maxima_table(run->summary) + broadest_text(run->summary);
  return text.empty() ? "" : section_heading("Shape of the similarity", "similarity") + text;
}

std::string field_parameters_section(const std::vector<EvaluationRun>& runs) {
  std::string text;
  for (const EvaluationRun* run : runs_of(runs, "field-parameters")) {
    HtmlTable table({{"(u,v) nodes", true},
                     {"(s,t) nodes", true},
                     {"Codewords", true},
                     {"Training share", true},
                     {"PSNR median (dB)", true},
                     {"Quartiles", true},
                     {"Lowest", true},
                     {"Uncompressed (MB)", true},
                     {"Payload (MB)", true},
                     {"Compression", true},
                     {"Creation (s)", true},
                     {"Ranks", true}},
                    "Every setting (the paper's Table I): the first is the one that all sweeps "
                    "share; compression is that of the payload");
    for (const json& setting : run->summary.at("settings")) {
      const json& psnr = setting.at("psnr_db");
      const double uncompressed = setting.at("uncompressed_bytes").get<double>();
      const double payload = setting.at("payload_bytes").get<double>();
      table.add_row({plain(setting.at("uv_nodes")),
                     plain(setting.at("st_nodes")),
                     plain(setting.at("codewords")),
                     plain(setting.at("training_fraction")),
                     decimals(psnr.at("median"), 2),
                     decimals(psnr.at("q1"), 2) + "–" + decimals(psnr.at("q3"), 2),
                     decimals(psnr.at("min"), 2),
                     decimals(uncompressed / 1e6, 1),
                     decimals(payload / 1e6, 1),
                     decimals(uncompressed / payload, 1),
                     decimals(setting.at("creation_seconds"), 1),
                     plain(setting.at("creation_ranks"))});
    }
    text += element("h3", "Camera " + escaped(run->summary.at("camera").get<std::string>())) +
            run_figure(*run,
                       "field-parameters",
                       "PSNR against each field parameter",
                       "<b>Image quality against the field's parameters</b> (the paper's Fig. 10): "
                       "medians and quartiles over " +
                           plain(run->summary.at("poses")) +
                           " random poses; the setting that all panels share is set off.",
                       "wide") +
            difference_text(*run) + table.html();
  }
  return text.empty() ? ""
                      : section_heading("What a field costs and gives", "field-parameters") + text;
}

}  // namespace af::evaluation
