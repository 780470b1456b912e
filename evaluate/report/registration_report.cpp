// SPDX-License-Identifier: Apache-2.0
#include <cctype>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <set>

#include "evaluate/outputs/sample_summary_json.h"
#include "evaluate/report/html_text.h"
#include "evaluate/report/number_html.h"
#include "evaluate/report/run_report.h"
#include "evaluate/report/sections_report.h"

namespace af::evaluation {

using nlohmann::json;

namespace {

std::string bar(double share) {
  return "<span class=\"bar\" style=\"--share:" + decimals(100 * share, 1) + "\"></span>";
}

/// How the starts of one interval were drawn, over all cases.
struct IntervalDraws {
  double draws = 0.0;
  double refused = 0.0;
  double share_sum = 0.0;    ///< of rotation
  double share_count = 0.0;  ///< cases
};

/// Of runs of earlier versions, and of starts that another run drew, not all is known.
IntervalDraws draws_of(const json& cases, std::size_t interval) {
  IntervalDraws all;
  const auto at = [&](const json& of_case, const char* key) {
    const json values = of_case.value(key, json::array());
    return interval < values.size() ? number_of(values.at(interval))
                                    : std::numeric_limits<double>::quiet_NaN();
  };
  for (const json& of_case : cases) {
    all.draws += at(of_case, "draws_per_interval");
    all.refused += at(of_case, "inadmissible_draws_per_interval");
    const double share = at(of_case, "rotation_share_per_interval");
    if (!std::isfinite(share)) continue;
    all.share_sum += share;
    all.share_count += 1.0;
  }
  return all;
}

std::string refused_text(const IntervalDraws& draws) {
  if (!(draws.draws > 0.0)) return "–";
  return decimals(draws.refused, 0) + " of " + decimals(draws.draws, 0) + " (" +
         percent(draws.refused / draws.draws) + ")";
}

/// What became of draws that the fields do not hold, by the run's rule.
std::string draws_text(const std::string& start_rule) {
  if (start_rule == "within-range")
    return "Starts were drawn inside the fields' motion range, so that turns that do not fit are "
           "missing: the share of rotation says what is left of the half that it makes up near "
           "the pose";
  if (start_rule == "given") return "The starts were given by a table";
  return "Draws outside the fields' motion range were refused and drawn again; where many were, "
         "rotation makes up less of the starts than the half that it does without refusals";
}

std::string success_table(const json& summary) {
  const json& renderers = summary.at("renderers");
  std::vector<HtmlTable::Column> columns = {{"Initial TRE (mm)", false}};
  for (const json& renderer : renderers) {
    columns.push_back({method_name(renderer) + ": starts", true});
    columns.push_back({"succeeded", true});
    columns.push_back({"rate (95 % interval)", false});
  }
  columns.push_back({"Draws refused", true});
  columns.push_back({"Share of rotation", true});
  HtmlTable table(columns,
                  "Success per interval of initial error, with Wilson intervals. " +
                      draws_text(summary.value("start_rule", "")));
  const std::size_t intervals = renderers.at(0).at("intervals").size();
  for (std::size_t i = 0; i < intervals; ++i) {
    const json& first = renderers.at(0).at("intervals").at(i);
    std::vector<std::string> cells = {decimals(first.at("low_mm"), 0) + "–" +
                                      decimals(first.at("high_mm"), 0)};
    for (const json& renderer : renderers) {
      const json& interval = renderer.at("intervals").at(i);
      cells.push_back(plain(interval.at("starts")));
      cells.push_back(plain(interval.at("successes")));
      cells.push_back(interval.at("starts") == 0 ? "–"
                                                 : element("span",
                                                           bar(number_of(interval.at("rate"))) +
                                                               rate_with_interval(interval),
                                                           "nowrap"));
    }
    const IntervalDraws draws = draws_of(summary.at("cases"), i);
    cells.push_back(element("span", refused_text(draws), "nowrap"));
    cells.push_back(draws.share_count > 0.0 ? decimals(draws.share_sum / draws.share_count, 2)
                                            : "–");
    table.add_row(cells);
  }
  return table.html();
}

std::string error_table(const json& renderers) {
  HtmlTable table(
      {{"Method", false},
       {"Starts", true},
       {"Median", true},
       {"Quartiles", true},
       {"95th percentile", true},
       {"Largest with a pose", true},
       {"No pose", true},
       {"Mean ± SD of successes", true},
       {"Same against stated pose", true},
       {"Gold standard by itself", true}},
      "TRE in mm over all registrations, one without a pose counting as infinitely far; "
      "then over successes only");
  for (const json& renderer : renderers) {
    const json& all = renderer.at("tre_of_all_mm");
    const json& good = renderer.at("tre_of_successes_mm");
    table.add_row({method_title(renderer),
                   plain(renderer.at("starts")),
                   decimals(all.at("median"), 2),
                   decimals(all.at("q1"), 2) + "–" + decimals(all.at("q3"), 2),
                   decimals(all.at("p95"), 2),
                   decimals(renderer.at("tre_mm").at("max"), 2),
                   plain(renderer.at("without_pose")),
                   decimals(good.at("mean"), 2) + " ± " + decimals(good.at("sd"), 2),
                   decimals(renderer.at("stated_pose_tre_of_successes_mm").at("mean"), 2),
                   decimals(renderer.value("gold_uncertainty_mm", json()), 2)});
  }
  return table.html();
}

/// Of the patients' own capture ranges the mean with its intervals, the smallest and the largest.
std::string own_captures_text(const json& renderer) {
  const json own = renderer.at("over_cases").value("capture_range_mm", json());
  if (!own.is_object()) return "–";
  std::string text = decimals(own.at("mean_mm"), 1) + " mm (" + decimals(own.at("min_mm"), 0) +
                     " to " + decimals(own.at("max_mm"), 0);
  if (own.at("low").is_number())
    text += "; over patients " + decimals(own.at("low"), 1) + "–" + decimals(own.at("high"), 1);
  if (own.at("student_low").is_number())
    text += ", Student " + decimals(own.at("student_low"), 1) + "–" +
            decimals(own.at("student_high"), 1);
  text += ")";
  if (own.at("at_least").get<std::int64_t>() > 0)
    text += "; of " + plain(own.at("at_least")) + " of " + plain(own.at("cases")) +
            " the study ends first";
  return text;
}

std::string threshold_table(const json& renderers) {
  std::vector<HtmlTable::Column> columns = {{"Error below", false}};
  for (const json& renderer : renderers) {
    columns.push_back({method_name(renderer) + ": TRE (95 % interval)", true});
    columns.push_back({method_name(renderer) + ": mRPD (95 % interval)", true});
  }
  HtmlTable table(columns,
                  "Share of all starts below other thresholds, by TRE and by the mean "
                  "reprojection distance (mRPD), which does not count what one view cannot see");
  const std::size_t count = renderers.at(0).at("thresholds").size();
  for (std::size_t i = 0; i < count; ++i) {
    const json& threshold = renderers.at(0).at("thresholds").at(i).at("threshold_mm");
    std::vector<std::string> cells = {decimals(threshold, threshold == 2.5 ? 1 : 0) + " mm"};
    for (const json& renderer : renderers) {
      cells.push_back(rate_with_interval(renderer.at("thresholds").at(i)));
      const json mrpd = renderer.value("mrpd_thresholds", json::array());
      cells.push_back(i < mrpd.size() ? rate_with_interval(mrpd.at(i)) : "–");
    }
    table.add_row(cells);
  }
  std::vector<std::string> gross = {"gross failures: 10 mm or more, or no pose"};
  for (const json& renderer : renderers) {
    gross.push_back(rate_with_interval(renderer.at("gross_failures")));
    // Runs of earlier versions counted by TRE alone.
    gross.push_back(renderer.contains("mrpd_gross_failures")
                        ? rate_with_interval(renderer.at("mrpd_gross_failures"))
                        : "–");
  }
  table.add_row(gross);
  return table.html();
}

std::string capture_table(const json& renderers) {
  HtmlTable table({{"Method", false},
                   {"Patients' own ranges: mean (smallest to largest; 95 %)", false},
                   {"All starts together (95 % over patients)", false},
                   {"Ended by", false},
                   {"By mRPD, all starts", true},
                   {"Cumulative", true}},
                  "Capture range: the first interval of initial error with a success below 95 % "
                  "ends it (van de Kraats et al. 2005). Cumulative: the largest initial error with "
                  "95 % success up to it, where close starts make up for far ones");
  for (const json& renderer : renderers) {
    const json& range = renderer.at("capture_range");
    const json pooled = renderer.at("over_cases").value("pooled_capture_range_mm", json());
    // Earlier versions called the cumulative range so.
    const bool is_cumulative = range.is_object() && !range.contains("ended_by");
    std::string together = is_cumulative ? "–" : capture_text(range);
    if (pooled.is_object() && pooled.at("low").is_number())
      together += " (" + decimals(pooled.at("low"), 0) + "–" + decimals(pooled.at("high"), 0) + ")";
    std::string end = "–";
    if (range.is_object() && range.contains("end_interval")) {
      const json& interval = range.at("end_interval");
      end = decimals(interval.at("low_mm"), 0) + "–" + decimals(interval.at("high_mm"), 0) +
            " mm: " +
            (interval.at("starts") == 0
                 ? std::string("no starts")
                 : plain(interval.at("successes")) + " of " + plain(interval.at("starts")));
    }
    table.add_row(
        {method_title(renderer),
         own_captures_text(renderer),
         together,
         end,
         capture_text(renderer.value("mrpd_capture_range", json())),
         capture_text(is_cumulative ? range : renderer.value("cumulative_capture_range", json()))});
  }
  return table.html();
}

/// Success by mRPD, where a case has one view only.
std::string one_view_text(const json& summary) {
  bool has_one_view = false;
  for (const json& of_case : summary.at("cases"))
    has_one_view = has_one_view || of_case.value("views", json()) == 1;
  if (!has_one_view) return "";
  std::string text;
  for (const json& renderer : summary.at("renderers"))
    text += " With " + method_title(renderer) + " " +
            rate_with_interval(renderer.at("mrpd_success")) +
            " of the starts end with an mRPD below " +
            decimals(renderer.at("mrpd_success").at("threshold_mm"), 1) + " mm.";
  return element(
      "p",
      "<strong>One view.</strong> A single view hardly shows the depth along its rays, "
      "so a TRE says little; the reprojection distance (mRPD) measures what the view can "
      "show." +
          text);
}

/// Failures of every kind, for each method.
std::string reason_table(const json& renderers) {
  std::set<std::string> reasons;
  std::vector<HtmlTable::Column> columns = {{"Reason", false}};
  for (const json& renderer : renderers) {
    columns.push_back({method_name(renderer) + ": failures", true});
    for (const auto& [reason, count] : renderer.at("failures_by_reason").items())
      reasons.insert(reason);
  }
  if (reasons.empty()) return "";
  HtmlTable table(columns, "Why registrations failed");
  for (const std::string& reason : reasons) {
    std::vector<std::string> cells = {escaped(reason)};
    for (const json& renderer : renderers)
      cells.push_back(plain(renderer.at("failures_by_reason").value(reason, json(0))));
    table.add_row(cells);
  }
  return table.html();
}

/// The other errors and the bias of the optimum, over successes.
std::string other_errors_table(const json& renderers) {
  HtmlTable table({{"Method", false},
                   {"mRPD (mm)", true},
                   {"On the detector (mm)", true},
                   {"In the isocentre plane (mm)", true},
                   {"Rotation, geodesic (deg)", true},
                   {"Translation (mm)", true},
                   {"Bias rx, ry, rz (deg)", true},
                   {"Bias tx, ty, tz (mm)", true}},
                  "Other errors of successes (means), and the mean signed error of each parameter");
  for (const json& renderer : renderers) {
    std::vector<std::string> cells = {method_title(renderer)};
    const json& errors = renderer.at("errors_of_successes");
    for (const char* name : {"mrpd_mm",
                             "projection_detector_mm",
                             "projection_isocenter_mm",
                             "rotation_error_deg",
                             "translation_error_mm"})
      cells.push_back(decimals(errors.at(name).at("mean"), 3));
    const json& bias = renderer.at("bias");
    const auto three = [&](const char* a, const char* b, const char* c) {
      return decimals(bias.at(a).at("mean"), 3) + ", " + decimals(bias.at(b).at("mean"), 3) + ", " +
             decimals(bias.at(c).at("mean"), 3);
    };
    cells.push_back(three("rx_deg", "ry_deg", "rz_deg"));
    cells.push_back(three("tx_mm", "ty_mm", "tz_mm"));
    table.add_row(cells);
  }
  return table.html();
}

/// How few patients affect the bootstrap, and which interval to take instead.
std::string optimism_text(const json& rate) {
  if (!rate.at("is_optimistic").get<bool>()) return "";
  std::string text =
      " <strong>With so few patients this interval is too narrow</strong>: it holds the "
      "truth less often than it says.";
  if (rate.value("student_low", json()).is_number())
    text += " Student's interval of the patients' own rates is " +
            percent(rate.at("student_low").get<double>()) + " to " +
            percent(rate.at("student_high").get<double>()) + ".";
  return text;
}

/// Intervals over patients, with a warning where these are too few.
std::string over_patients_text(const json& renderers) {
  std::string text;
  for (const json& renderer : renderers) {
    const json& rate = renderer.at("over_cases").at("rate");
    const auto patients = count_of(rate.at("cases"));
    if (!rate.at("low").is_number()) continue;
    text +=
        element("p",
                "<strong>Over patients</strong> (" + method_title(renderer) + "): resampling the " +
                    std::to_string(patients) + " patients gives a 95 % interval of " +
                    percent(rate.at("low").get<double>()) + " to " +
                    percent(rate.at("high").get<double>()) + " for the success rate." +
                    optimism_text(rate));
  }
  if (!text.empty()) return text;
  return element("p", "One patient says nothing about others: there is no interval over patients.");
}

std::string problems_text(const json& problems) {
  if (problems.empty()) return "";
  std::string items;
  for (const json& problem : problems) items += element("li", escaped(problem.get<std::string>()));
  return element("div",
                 element("p", "<strong>The rows have problems:</strong>") + element("ul", items),
                 "caution");
}

std::string case_table(const json& summary) {
  HtmlTable table({{"Case", false},
                   {"Method", false},
                   {"Starts", true},
                   {"Success (95 % interval)", true},
                   {"Capture range", true},
                   {"Mean TRE of successes (mm)", true},
                   {"Gold standard by itself (mm)", true},
                   {"Median seconds", true},
                   {"Median evaluations", true}},
                  "Per case: a patient, or one of a patient's poses (the paper's Table II)");
  for (const json& renderer : summary.at("renderers"))
    for (const json& entry : renderer.at("cases"))
      table.add_row(
          {escaped(entry.at("case").get<std::string>()),
           method_title(renderer),
           plain(entry.at("starts")),
           rate_with_interval(entry),
           // Earlier versions called the cumulative range so.
           entry.at("capture_range").is_object() && !entry.at("capture_range").contains("ended_by")
               ? "–"
               : capture_text(entry.at("capture_range")),
           decimals(entry.at("tre_of_successes_mm").at("mean"), 2),
           decimals(entry.value("gold_uncertainty_mm", json()), 2),
           decimals(entry.at("seconds").at("median"), 2),
           decimals(entry.at("evaluations").at("median"), 0)});
  return table.html();
}

std::string gold_table(const json& cases) {
  HtmlTable table({{"Case", false},
                   {"Gold pose from", false},
                   {"Fiducials", true},
                   {"FRE (mm)", true},
                   {"Largest ray gap (mm)", true},
                   {"Leave-one-out (mm)", true},
                   {"Own TRE: mean, 95th percentile (mm)", true},
                   {"Stated pose to fiducials (mm)", true},
                   {"Draws", true},
                   {"of these outside the fields' range", true},
                   {"beyond the last interval", true}},
                  "Gold standard and starts");
  for (const json& entry : cases) {
    const json& gold = entry.at("gold");
    const json uncertainty = gold.value("uncertainty", json::object());
    double largest_gap_mm = std::numeric_limits<double>::quiet_NaN();
    for (const json& gap : gold.value("ray_gaps_mm", json::array()))
      largest_gap_mm = std::fmax(largest_gap_mm, gap.get<double>());
    table.add_row({escaped(entry.at("case").get<std::string>()),
                   gold.at("source") == "fiducials" ? "fiducials" : "the study's stated pose",
                   std::to_string(gold.value("residuals_mm", json::array()).size()),
                   decimals(gold.value("fre_mm", json()), 3),
                   decimals(number_json(largest_gap_mm), 3),
                   decimals(gold.value("leave_one_out_rms_mm", json()), 3),
                   decimals(uncertainty.value("mean_tre_mm", json()), 3) + ", " +
                       decimals(uncertainty.value("p95_tre_mm", json()), 3),
                   decimals(gold.value("stated_to_fiducials_mm", json()), 3),
                   plain(entry.at("draws")),
                   plain(entry.at("inadmissible_draws")),
                   plain(entry.at("draws_beyond_last_interval"))});
  }
  return table.html();
}

std::string p_text(double p) {
  return p < 0.001 ? "p &lt; 0.001" : "p = " + decimals(p, 3);
}

/// Tests that take starts for independent: they tell of these X-rays only.
std::string pooled_test_text(const json& test) {
  return " Over these starts TRE differs by " + decimals(test.at("mean_difference_mm"), 3) +
         " mm on average (90 % interval " + decimals(test.at("low_90_mm"), 3) + " to " +
         decimals(test.at("high_90_mm"), 3) + " mm; paired t-test " +
         p_text(test.at("t_test_p").get<double>()) + ", Wilcoxon's signed-rank test " +
         p_text(test.at("signed_rank_p").get<double>()) +
         "). These tests take starts for independent, which those of one patient are not, and "
         "errors in opposite directions cancel in them: they show no equivalence.";
}

/// What is claimed of the distance between end poses, and over which patients.
std::string equivalence_text(const json& ends) {
  const json& over = ends.at("over_cases");
  const std::string margin = decimals(ends.at("margin_mm"), 2);
  std::string text = " Where both succeeded their end poses lie " + decimals(over.at("mean"), 3) +
                     " mm apart (mean over the target and over " +
                     counted(count_of(over.at("cases")), "patient", "patients");
  if (over.at("low").is_number())
    text += "; 95 % over patients " + decimals(over.at("low"), 3) + " to " +
            decimals(over.at("high"), 3) + " mm by bootstrap";
  if (over.at("student_low").is_number())
    text += ", " + decimals(over.at("student_low"), 3) + " to " +
            decimals(over.at("student_high"), 3) + " mm by Student's";
  text += "; 95th percentile of starts " + decimals(ends.at("pairs").at("p95"), 3) + ", largest " +
          decimals(ends.at("pairs").at("max"), 3) + " mm).";
  const json& is_equivalent = ends.at("is_equivalent");
  if (is_equivalent.is_null())
    return text + " <strong>Nothing is claimed about equivalence</strong>: that needs " +
           plain(ends.at("cases_needed")) + " patients.";
  return text +
         (is_equivalent.get<bool>()
              ? " Over patients the two are equivalent within " + margin +
                    " mm, and succeed alike: "
              : " Equivalence within " + margin + " mm is not shown over patients: ") +
         "one-sided Student's test " + p_text(number_of(ends.at("p"))) + ".";
}

std::string paired_text(const json& paired) {
  if (!paired.is_object()) return "";
  std::string text = "<strong>Field against ray casting</strong>, the " +
                     counted(count_of(paired.at("common_starts")), "start", "starts") +
                     " given to both: " + plain(paired.at("successes").at(0)) + " and " +
                     plain(paired.at("successes").at(1)) + " successes (McNemar " +
                     p_text(paired.at("mcnemar_p").get<double>()) + ").";
  if (paired.contains("end_distance_mm")) text += equivalence_text(paired.at("end_distance_mm"));
  if (paired.contains("test")) text += pooled_test_text(paired.at("test"));
  return element("p", text);
}

/// The folder of a result that Slicer loads, where there is one.
std::string slicer_link(const EvaluationRun& run, const json& picture) {
  const std::string folder = picture.value("slicer", "");
  if (folder.empty()) return "";
  return element("span", "<a href=\"" + run.link(folder) + "\">for Slicer</a>", "files");
}

std::string overlay_figures(const EvaluationRun& run) {
  std::string figures;
  for (const json& picture : run.summary.at("pictures")) {
    const std::string which = picture.at("which").get<std::string>();
    const std::string name = picture.at("file").get<std::string>();
    const std::string case_name = escaped(picture.at("case").get<std::string>());
    if (which == "setting") continue;
    if (which == "xrays") {
      figures += figure(
          run.file(name),
          "image/png",
          "X-rays of the case",
          "<b>Case " + case_name + ".</b> The X-rays and, framed, the regions that are compared.",
          "picture wide");
      continue;
    }
    figures +=
        figure(run.file(name),
               "image/png",
               which + " registration as overlay",
               "<b>Case " + case_name + ", the " + escaped(which) + " result, view " +
                   escaped(picture.at("camera").get<std::string>()) + ".</b> By " +
                   method_title(picture) + ", start " + plain(picture.at("start_index")) +
                   ", from " + decimals(picture.at("initial_tre_mm"), 1) + " mm to " +
                   decimals(picture.at("tre_mm"), 2) + " mm TRE." + slicer_link(run, picture),
               "picture");
  }
  return element("div", figures, "figures");
}

/// Where the starts come from, as far as the run says.
std::string starts_text(const json& summary) {
  if (summary.contains("only_start")) return "One start of another run, repeated alone.";
  return "Starts are poses about the gold pose at stated initial target registration errors (TRE), "
         "the same for every method.";
}

std::string registration_figures(const EvaluationRun& run) {
  return element("div",
                 run_figure(run,
                            "success-rate",
                            "Success rate per interval of initial error",
                            "<b>Success against initial error</b> (the paper's Fig. 16). Dots: "
                            "share of starts that end below " +
                                decimals(run.summary.at("success_tre_mm"), 1) +
                                " mm; bars: 95 % Wilson intervals; dashed: 95 %.") +
                     run_figure(run,
                                "tre-scatter",
                                "Initial against final error",
                                "<b>Where registrations started and ended</b>, one mark each; of "
                                "very many only a part, as the title says.") +
                     run_figure(run,
                                "tre-histogram",
                                "Histogram of the error after registration",
                                "<b>Error after registration</b> (the paper's Fig. 15); the last "
                                "bar holds everything beyond 5 mm and registrations without a "
                                "pose."),
                 "figures");
}

/// Sentences of a list of texts, as items; each once over the pictures of a case.
std::string items_of(const json& texts, const char* before) {
  std::string items;
  for (const json& text : texts) items += element("li", before + escaped(text.get<std::string>()));
  return items;
}

/// What af-inspect --pictures draws of a study, of every case: whether its parts fit together.
std::string setting_text(const EvaluationRun& run) {
  std::string html;
  std::string last_case;
  for (const json& picture : run.summary.at("pictures")) {
    if (picture.at("which") != "setting") continue;
    const std::string case_name = picture.at("case").get<std::string>();
    if (case_name != last_case)
      html += element("p", "<b>Case " + escaped(case_name) + "</b>") +
              element("ul",
                      items_of(picture.value("telltales", json::array()), "<b>Look:</b> ") +
                          items_of(picture.value("facts", json::array()), ""));
    last_case = case_name;
    html += figure(run.file(picture.at("file").get<std::string>()),
                   "image/png",
                   "X-ray and DRRs before the registration, or the room",
                   escaped(picture.value("shows", "")),
                   "picture wide");
  }
  if (html.empty()) return "";
  return element("h3", "Whether the study fits together") +
         element("p",
                 "X-rays as they are, DRRs cast at the nominal pose and, where there are "
                 "landmarks, at theirs, with the patient's directions at the edges; the room with "
                 "sources, detectors and the CT's box. Nothing is flipped or scaled.") +
         html;
}

std::string appearance_text(const EvaluationRun& run) {
  const json& summary = run.summary;
  if (summary.at("pictures").empty()) return "";
  return element("h3", "What it looks like") +
         element("p",
                 std::string("X-ray, DRR at the found pose, both as a checkerboard, and their "
                             "difference, all as attenuation: what attenuates more is brighter.") +
                     (summary.at("simulation").is_object()
                          ? " Small bright bars are the steel fiducials, which the CT lacks."
                          : "")) +
         overlay_figures(run);
}

}  // namespace

std::string registration_section(const EvaluationRun& run, const std::string& title) {
  const json& summary = run.summary;
  const json& renderers = summary.at("renderers");
  return section_heading(escaped(title), run_id(run)) + element("p", starts_text(summary)) +
         problems_text(summary.at("row_problems")) + registration_figures(run) +
         success_table(summary) + capture_table(renderers) + error_table(renderers) +
         threshold_table(renderers) + one_view_text(summary) + other_errors_table(renderers) +
         over_patients_text(renderers) + paired_text(summary.at("field_against_raycast")) +
         case_table(summary) + gold_table(summary.at("cases")) + element("h3", "Failures") +
         reason_table(renderers) + failures_text(run) + appearance_text(run) + setting_text(run);
}

}  // namespace af::evaluation
