// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "base/joined.h"
#include "evaluate/outputs/sample_summary_json.h"
#include "evaluate/report/html_text.h"
#include "evaluate/report/number_html.h"
#include "evaluate/report/run_report.h"
#include "evaluate/report/sections_report.h"

namespace af::evaluation {

using nlohmann::json;

namespace {

/// With more runs than this, tables tell more than sentences and tiles.
constexpr std::size_t kMostSentences = 4;
constexpr std::size_t kMostTiles = 4;

std::string tile(const std::string& value,
                 const std::string& unit,
                 const std::string& label,
                 const std::string& detail) {
  return element("div",
                 element("div", value + (unit.empty() ? "" : element("small", unit)), "value") +
                     element("div", label, "label") + element("div", detail, "detail"),
                 "tile");
}

double median_seconds(const json& renderer) {
  return number_of(renderer.at("seconds").at("median"));
}

/// Upper end of the intervals, from 0 mm on, in which every start succeeded; 0 when even the first
/// has a failure.
double flawless_up_to_mm(const json& renderer) {
  double end_mm = 0.0;
  for (const json& interval : renderer.at("intervals")) {
    if (interval.at("starts") == 0) continue;
    if (interval.at("successes") != interval.at("starts")) break;
    end_mm = interval.at("high_mm").get<double>();
  }
  return end_mm;
}

/// How far starts may lie, by the range of all starts of that name; empty for a run of an earlier
/// version, which meant another range.
std::string capture_sentence(const json& renderer, const char* name = "capture_range") {
  const json& range = renderer.at(name);
  if (!range.is_object() || !range.contains("ended_by")) return "";
  const json own = renderer.at("over_cases").value("capture_range_mm", json());
  if (own.is_object() && own.at("cases").get<std::int64_t>() > 1)
    return " Capture range per patient: " +
           std::string(own.at("at_least") == 0 ? "" : "at least ") +
           decimals(own.at("mean_mm"), 1) + " mm on average, " + decimals(own.at("min_mm"), 0) +
           " mm at worst.";
  return " Capture range: " + capture_text(range) + ".";
}

/// Of runs with one view, which shows no depth.
std::string one_view_sentence(const json& renderer, double threshold_mm) {
  const json& right = renderer.at("mrpd_success");
  const auto starts = count_of(right.at("starts"));
  const auto successes = count_of(right.at("successes"));
  std::string text =
      "With " + method_title(renderer) + " and one view, " + std::to_string(successes) + " of " +
      counted(starts, "registration", "registrations") + " (" +
      percent(number_of(right.at("rate"))) + ", 95 % interval " + interval_text(right) +
      ") ended with a reprojection distance (mRPD) below " + decimals(threshold_mm, 1) + " mm";
  if (successes == 0) return text + ".";
  return text + "; of these it was " +
         decimals(renderer.at("errors_of_successes").at("mrpd_mm").at("mean"), 2) +
         " mm on average." + capture_sentence(renderer, "mrpd_capture_range") +
         (successes == starts ? " None failed." : "");
}

std::string success_sentence(const json& renderer, double threshold_mm) {
  const auto starts = count_of(renderer.at("starts"));
  const auto successes = count_of(renderer.at("successes"));
  std::string text = "With " + method_title(renderer) + ", " + std::to_string(successes) + " of " +
                     counted(starts, "registration", "registrations") + " (" +
                     percent(number_of(renderer.at("rate"))) + ", 95 % interval " +
                     interval_text(renderer) + ") ended less than " + decimals(threshold_mm, 1) +
                     " mm from the gold pose";
  if (successes == 0) return text + ".";
  text += "; these ended " + decimals(renderer.at("tre_of_successes_mm").at("mean"), 2) +
          " mm from it on average.";
  const double flawless_mm = flawless_up_to_mm(renderer);
  text += capture_sentence(renderer);
  if (successes == starts)
    text += " None failed.";
  else if (flawless_mm > 0.0)
    text += " Every start closer than " + decimals(flawless_mm, 0) + " mm succeeded.";
  else
    text += " Failures begin with the very closest starts.";
  return text;
}

std::string speed_sentence(const json& paired) {
  if (!paired.is_object()) return "";
  const double field = paired.at("median_seconds").at(0).get<double>();
  const double raycast = paired.at("median_seconds").at(1).get<double>();
  if (!(field > 0.0)) return "";
  return "From the " + counted(count_of(paired.at("common_starts")), "start", "starts") +
         " given to both, a registration took " + seconds_text(field) + " with fields and " +
         seconds_text(raycast) + " with ray casting (medians): " + decimals(raycast / field, 0) +
         " times as long, on this computer.";
}

std::string sentence_of(const json& summary, const json& renderer) {
  const double threshold_mm = summary.at("success_tre_mm").get<double>();
  return is_of_one_view(summary) ? one_view_sentence(renderer, threshold_mm)
                                 : success_sentence(renderer, threshold_mm);
}

std::string registration_sentences(const EvaluationRun& run) {
  const json& summary = run.summary;
  std::string items;
  for (const json& renderer : summary.at("renderers"))
    items += element("li", sentence_of(summary, renderer));
  const std::string speed = speed_sentence(summary.at("field_against_raycast"));
  if (!speed.empty()) items += element("li", speed);
  return items;
}

/// One of several runs: its first method, and how long the others take. A table has the rest.
std::string run_sentences(const EvaluationRun& run) {
  const json& summary = run.summary;
  return element("li",
                 "<b>" + escaped(run.name) + ":</b> " +
                     sentence_of(summary, summary.at("renderers").at(0)) + " " +
                     speed_sentence(summary.at("field_against_raycast")));
}

double median_psnr_db(const EvaluationRun& run) {
  return number_of(run.summary.at("psnr_db").at("median"));
}

/// The runs, or none when there are too many.
std::vector<const EvaluationRun*> at_most(const std::vector<const EvaluationRun*>& runs,
                                          std::size_t count) {
  return runs.size() > count ? std::vector<const EvaluationRun*>() : runs;
}

std::string quality_sentence(const std::vector<const EvaluationRun*>& runs) {
  if (runs.empty()) return "";
  std::string list;
  if (runs.size() > kMostTiles) {
    const auto [lowest, highest] =
        std::minmax_element(runs.begin(), runs.end(), [](const auto* a, const auto* b) {
          return median_psnr_db(*a) < median_psnr_db(*b);
        });
    list = decimals(median_psnr_db(**lowest), 1) + " to " + decimals(median_psnr_db(**highest), 1) +
           " dB over " + std::to_string(runs.size()) + " fields";
  }
  for (const EvaluationRun* run : at_most(runs, kMostTiles))
    list += (list.empty() ? "" : ", ") + decimals(run->summary.at("psnr_db").at("median"), 1) +
            " dB (" + escaped(field_name(*run)) + ")";
  return element("li",
                 "The fields' images agree with ray casting to a median PSNR of " + list + ".");
}

std::string seconds_tile(const json& renderer) {
  const std::string seconds = seconds_text(median_seconds(renderer));
  const std::size_t blank = seconds.find(' ');
  return tile(seconds.substr(0, blank),
              blank == std::string::npos ? "" : seconds.substr(blank + 1),
              "per registration",
              method_title(renderer) + ", median");
}

/// The gold standard's own error, to stand beside another error.
std::string gold_text(const json& renderer) {
  const json gold_mm = renderer.value("gold_uncertainty_mm", json());
  return gold_mm.is_number() ? "; the gold standard by itself: " + decimals(gold_mm, 2) + " mm"
                             : "";
}

/// Success, error and time of the first method, time of the others.
std::string registration_tiles(const EvaluationRun& run) {
  const json& renderers = run.summary.at("renderers");
  const json& first = renderers.at(0);
  const bool by_mrpd = is_of_one_view(run.summary);
  const json& rate = by_mrpd ? first.at("mrpd_success").at("rate") : first.at("rate");
  const json& errors =
      by_mrpd ? first.at("errors_of_successes").at("mrpd_mm") : first.at("tre_of_successes_mm");
  const std::string which = by_mrpd ? " (mRPD)" : "";
  std::string tiles =
      tile(percent(number_of(rate)),
           "",
           "of starts succeed" + which,
           method_title(first) + ", " + counted(count_of(first.at("starts")), "start", "starts")) +
      tile(decimals(errors.at("mean"), 2),
           "mm",
           "mean error of successes" + which,
           method_title(first) + gold_text(first));
  for (const json& renderer : renderers) tiles += seconds_tile(renderer);
  return tiles;
}

/// Which X-rays are simulated; empty when none is.
std::string simulated_xrays_text(const std::vector<const EvaluationRun*>& registrations) {
  std::vector<std::string> simulated;
  for (const EvaluationRun* run : registrations)
    if (run->summary.at("simulation").is_object()) simulated.push_back(escaped(run->name));
  if (simulated.empty()) return "";
  const std::string which = simulated.size() == registrations.size()
                                ? "The X-rays are simulated"
                                : "The X-rays of " + std::to_string(simulated.size()) + " of " +
                                      std::to_string(registrations.size()) +
                                      " runs of registrations are simulated";
  const bool are_named =
      simulated.size() < registrations.size() && simulated.size() <= kMostSentences;
  const std::string names = are_named ? " (" + joined(simulated, ", ") + ")" : "";
  return element("p",
                 "<strong>" + which + "</strong>" + names +
                     ", with effects that neither fields nor ray casting model (<a "
                     "href=\"#xrays\">how</a>). Real X-rays hold more: motion, devices, "
                     "calibration errors.");
}

}  // namespace

std::string summary_section(const std::vector<EvaluationRun>& runs) {
  const auto registrations = runs_of(runs, "registration");
  const auto qualities = runs_of(runs, "image-quality");
  std::string sentences;
  std::string tiles;
  for (const EvaluationRun* run : registrations) {
    if (registrations.size() == 1) {
      sentences += registration_sentences(*run);
      tiles += registration_tiles(*run);
    } else if (registrations.size() <= kMostSentences) {
      sentences += run_sentences(*run);
    }
  }
  sentences += quality_sentence(qualities);
  for (const EvaluationRun* run : at_most(qualities, kMostTiles))
    tiles += tile(decimals(run->summary.at("psnr_db").at("median"), 1),
                  "dB",
                  "median PSNR of the field",
                  escaped(field_name(*run)) + ", against ray casting");
  const std::string caution = simulated_xrays_text(registrations) +
                              element("p", "Research software, not a medical device.");
  return element("section",
                 element("ul", sentences) + (tiles.empty() ? "" : element("div", tiles, "tiles")) +
                     element("div", caution, "caution"),
                 "summary");
}

}  // namespace af::evaluation
