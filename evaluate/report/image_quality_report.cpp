// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <filesystem>

#include "base/error.h"
#include "evaluate/outputs/paper_setting.h"
#include "evaluate/outputs/result_figures.h"
#include "evaluate/outputs/sample_summary_json.h"
#include "evaluate/report/html_text.h"
#include "evaluate/report/number_html.h"
#include "evaluate/report/sections_report.h"
#include "files/output_file.h"
#include "text/csv_table.h"

namespace af::evaluation {

using nlohmann::json;

namespace {

constexpr const char* kBoxPlotCaption =
    "<b>PSNR at random poses</b> (the paper's Fig. 8). Box: quartiles and median; whiskers: 5th "
    "and "
    "95th percentile; dots: every pose.";

bool are_papers_setting(const std::vector<const EvaluationRun*>& runs) {
  return std::all_of(runs.begin(), runs.end(), [](const EvaluationRun* run) {
    return is_papers_setting(run->summary.at("field"));
  });
}

/// One box plot of all fields. For several runs it is drawn anew from their tables.
std::string joint_box_plot(const std::vector<const EvaluationRun*>& runs,
                           const std::filesystem::path& figures) {
  constexpr const char* kAlternative = "Box plots of PSNR";
  if (runs.size() == 1)
    return run_figure(*runs.front(), "psnr", kAlternative, kBoxPlotCaption, "narrow");
  std::vector<PsnrGroup> groups;
  for (const EvaluationRun* run : runs) {
    const CsvTable rows = run->table("image-quality.csv");
    PsnrGroup group{field_name(*run), {}};
    for (std::size_t i = 0; i < rows.row_count(); ++i) {
      const std::string& text = rows.text(i, "psnr_db");
      if (text == "nan" || text == "inf") continue;
      group.psnr_db.push_back(rows.number(i, "psnr_db"));
      constexpr double kMostDb = 1000;
      if (std::abs(group.psnr_db.back()) > kMostDb)
        throw FileError(rows.where(i), "psnr_db", "within ±1000", text);
    }
    groups.push_back(std::move(group));
  }
  const OutputLock lock = make_output_folder(figures);
  draw_psnr_boxes(groups,
                  are_papers_setting(runs) ? PaperLevels::Shown : PaperLevels::Hidden,
                  figures / "psnr");
  return report_figure(figures / "psnr",
                       runs.front()->page_folder,
                       kAlternative,
                       kBoxPlotCaption,
                       runs.size() > 3 ? "wide" : "narrow");
}

/// The range of a field: two numbers, or the bounds of a box that these do not state. Runs of
/// earlier versions have numbers alone.
std::string range_text(const json& field) {
  const std::string text = field.value("range", "+-");
  if (!text.starts_with("+-")) return escaped(text);
  return "±" + decimals(field.at("max_rotation_deg"), 0) + "°, ±" +
         decimals(field.at("max_translation_mm"), 0) + " mm";
}

std::string nodes_text(const json& field) {
  const auto pair = [&](const char* key) {
    return plain(field.at(key).at(0)) + "×" + plain(field.at(key).at(1));
  };
  return pair("uv_nodes") + ", " + pair("st_nodes") +
         (field.at("slabs") == 1 ? "" : " × " + plain(field.at("slabs")) + " slabs");
}

std::string quality_table(const std::vector<const EvaluationRun*>& runs) {
  HtmlTable table({{"Field", false},
                   {"Nodes (u,v), (s,t)", true},
                   {"Codewords", true},
                   {"File (MB)", true},
                   {"Range", true},
                   {"Poses", true},
                   {"Median", true},
                   {"5th percentile", true},
                   {"Minimum", true},
                   {"Above 40 dB", true},
                   {"Below 36 dB", true},
                   {"Field, per DRR", true},
                   {"Ray cast, per DRR", true}},
                  "PSNR in dB against ray casting; times are medians of whole-detector DRRs on one "
                  "core of this computer");
  for (const EvaluationRun* run : runs) {
    const json& summary = run->summary;
    const json& field = summary.at("field");
    const json& psnr = summary.at("psnr_db");
    constexpr double kBytesPerMb = 1e6;
    table.add_row({escaped(field_name(*run)),
                   nodes_text(field),
                   plain(field.at("codewords")),
                   decimals(field.at("file_bytes").get<double>() / kBytesPerMb, 1),
                   range_text(field),
                   plain(summary.at("compared")),
                   decimals(psnr.at("median"), 1),
                   decimals(psnr.at("p5"), 1),
                   decimals(psnr.at("min"), 1),
                   percent(number_of(summary.at("share_above_40_db"))),
                   percent(number_of(summary.at("share_below_36_db"))),
                   seconds_text(number_of(summary.at("seconds_per_drr_field").at("median"))),
                   seconds_text(number_of(summary.at("seconds_per_drr_raycast").at("median")))});
  }
  // Beside fields of another range or camera the paper's numbers would mislead.
  if (are_papers_setting(runs))
    table.add_row({"Paper, 2005",
                   "64×64, 256×256",
                   "16384",
                   "32",
                   "±10°, ±100 mm",
                   "100",
                   "&gt; 43",
                   "",
                   "",
                   "almost all",
                   "very few",
                   "50 ms",
                   "1.5 s"},
                  "reference");
  return table.html();
}

/// Median PSNR with one part of the chain alone in force, and its share of the mean square error.
std::string loss_text(const EvaluationRun& run) {
  if (!run.summary.contains("loss_split")) return "";
  const json& split = run.summary.at("loss_split");
  HtmlTable table({{"Lossy step", false}, {"Median PSNR (dB)", true}, {"Share of the error", true}},
                  "Interpolation in one plane alone, in both, quantisation alone, and all of it; "
                  "shares are of the field's mean square error "
                  "and need not add up to 100 %, since errors of steps add or cancel");
  for (const json& part : split.at("parts"))
    table.add_row({escaped(part.at("label").get<std::string>()),
                   decimals(part.at("psnr_db").at("median"), 1),
                   percent(number_of(part.at("share_of_total")))});
  return run_figure(run,
                    "loss-split",
                    "Box plots of PSNR by lossy step",
                    "<b>Where quality is lost, " + escaped(field_name(run)) + "</b>, over " +
                        plain(split.at("poses")) + " poses.",
                    "narrow") +
         table.html();
}

std::string loss_section(const std::vector<const EvaluationRun*>& runs) {
  std::string text;
  for (const EvaluationRun* run : runs) text += loss_text(*run);
  return text.empty() ? "" : element("h3", "Loss by interpolation and by quantisation") + text;
}

std::string pair_pictures(const EvaluationRun& run) {
  std::string figures;
  for (const json& picture : run.summary.at("pictures"))
    figures += figure(run.file(picture.at("file").get<std::string>()),
                      "image/png",
                      "field and ray cast side by side",
                      "<b>" + escaped(field_name(run)) + ", the " +
                          escaped(picture.at("which").get<std::string>()) + " pair.</b> PSNR " +
                          decimals(picture.at("psnr_db"), 1) + " dB.",
                      "picture wide");
  return figures;
}

}  // namespace

std::string image_quality_section(const std::vector<EvaluationRun>& runs,
                                  const std::filesystem::path& figures) {
  const auto qualities = runs_of(runs, "image-quality");
  if (qualities.empty()) return "";
  std::string pictures;
  for (const EvaluationRun* run : qualities) pictures += pair_pictures(*run);
  return section_heading("Image quality of the fields", "image-quality") +
         element("p",
                 "Images looked up in the compressed fields, compared with ray casting through "
                 "the CT at random poses of the fields' whole motion range.") +
         joint_box_plot(qualities, figures) + quality_table(qualities) +
         element("p",
                 "The paper's row: skull, thorax and pelvis, frontal and lateral. Its times are "
                 "those of a 2.2 GHz Xeon of 2005 for 256 × 256 pixels of a "
                 "512 × 512 × 512 CT, its sizes those of its format; they are given for scale.",
                 "note") +
         element("div", pictures, "figures") + loss_section(qualities);
}

}  // namespace af::evaluation
