// SPDX-License-Identifier: Apache-2.0
#include "register/verdict/verdict.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "base/sample_summary.h"

namespace af::registration {
namespace {

/// Rounded down, so that it reaches a limit only where the probability does: "99.6 %".
std::string percent_text(double probability) {
  const auto tenths = static_cast<int>(std::min(999.0, std::floor(1000.0 * probability)));
  return std::to_string(tenths / 10) + "." + std::to_string(tenths % 10) + " %";
}

bool is_far_below_others(std::size_t view,
                         std::span<const ViewValue> values,
                         double ViewValue::*value,
                         double well_explained) {
  double highest = 0.0;
  for (std::size_t i = 0; i < values.size(); ++i)
    if (i != view && values[i].*value > highest) highest = values[i].*value;
  return highest >= well_explained &&
         values[view].*value < std::min(well_explained, kLeastShareOfOthers * highest);
}

/// Rounded up: "0.1 mm", "9.9 mm", "24 mm".
std::string length_text(double mm) {
  const auto tenths = static_cast<std::int64_t>(std::ceil(10.0 * mm));
  return (tenths < 100 ? std::to_string(tenths / 10) + "." + std::to_string(tenths % 10)
                       : std::to_string((tenths + 9) / 10)) +
         " mm";
}

/// Beyond this distance a target disagrees with its surroundings. It depends on how much of the
/// X-rays is explained.
double apart_limit_mm(std::span<const ViewValue> values) {
  const double explained = std::clamp(summary_of(values, &ViewValue::coarse).mean, 0.0, 1.0);
  return std::min(kMostTargetApartMm,
                  kTargetApartMm + kTargetApartUnexplainedMm * (1.0 - explained));
}

}  // namespace

const char* to_string(Verdict verdict) {
  switch (verdict) {
    case Verdict::Found:
      return "found";
    case Verdict::Doubtful:
      return "doubtful";
    case Verdict::NotFound:
      return "not found";
  }
  return "";
}

std::optional<std::string> failure_of(StopReason stop_reason) {
  switch (stop_reason) {
    case StopReason::StartInadmissible:
      return "nothing was searched: the field does not hold all rays of the start";
    case StopReason::CtOutsideRoi:
      return "nothing was searched: no CT point projects into the region of interest at the start";
    case StopReason::NonFiniteSimilarity:
      return "the similarity is not a finite number";
    case StopReason::NoBetterThanNoDrr:
      return "no chain ended at a pose that explains the X-rays' gradients better than no DRR at "
             "all";
    default:
      return std::nullopt;
  }
}

std::vector<std::string> doubts_of(const RegistrationResult& result,
                                   std::span<const ViewValue> values,
                                   const TargetEvidence& target) {
  std::vector<std::string> doubts;
  if (result.stop_reason == StopReason::PinnedAtLimit)
    doubts.push_back((result.pinned_along.empty()
                          ? "the search ended at the limit of the field"
                          : "the field's range ends here along " + result.pinned_along) +
                     ": the optimum may lie outside");
  if (result.stop_reason == StopReason::EvaluationBudgetSpent)
    doubts.emplace_back("the search was not finished: --max-evaluations is spent");
  for (std::size_t i = 0; i < values.size(); ++i)
    if (!std::isfinite(values[i].coarse) || !std::isfinite(values[i].fine))
      doubts.push_back("X-ray " + std::to_string(i + 1) + " of " + std::to_string(values.size()) +
                       " cannot be judged: it shows no gradients over most of twice the region");
  if (target.share < kLeastTargetShare)
    doubts.push_back("the target shows nothing of its own: of what the pose explains there, " +
                     percent_text(1.0 - target.share) + " is its surroundings");
  else if (target.apart_mm > apart_limit_mm(values))
    doubts.push_back("the target disagrees with its surroundings: by itself it fits " +
                     length_text(target.apart_mm) +
                     " from here; it may have moved against the rest");
  return doubts;
}

bool agrees_with_surroundings(const TargetEvidence& target, std::span<const ViewValue> values) {
  return target.share >= kLeastTargetShare && target.apart_mm <= apart_limit_mm(values);
}

double confidence_if_target_agrees(double confidence) {
  return kAgreementOdds * confidence / (1.0 + (kAgreementOdds - 1.0) * confidence);
}

Judgement judged_confidence(const UncertaintyReport& report, std::span<const ViewValue> values) {
  if (!std::isfinite(report.confidence))
    return {Verdict::Doubtful,
            "how probably it is right is not known: no X-ray has gradients to judge the pose by, "
            "or the field holds no pose beside it to compare with"};
  const bool has_one_view = values.size() == 1;
  // The confidence of one view uses no TRE. 0: there is no end.
  const bool needs_tre = !has_one_view || values.front().in_silhouette;
  const bool is_bound = needs_tre && !std::isfinite(report.tre_rms_mm) && report.confidence > 0.0;
  const std::string right = std::string("right with ") + (is_bound ? "at least " : "") +
                            percent_text(report.confidence) + (has_one_view ? " (mRPD" : " (TRE") +
                            " below 2.5 mm), at least ";
  if (report.confidence < kLeastConfidence && !is_bound)
    return {Verdict::NotFound, right + percent_text(kLeastConfidence) + " wanted"};
  return {report.confidence >= 1.0 - kFoundRisk ? Verdict::Found : Verdict::Doubtful,
          right + percent_text(1.0 - kFoundRisk) + " wanted"};
}

std::string depth_text(double depth_95_mm) {
  if (!std::isfinite(depth_95_mm)) return "depth along the beam not known";
  const auto tenths = static_cast<std::int64_t>(std::ceil(10.0 * depth_95_mm));
  const std::string text = tenths < 100
                               ? std::to_string(tenths / 10) + "." + std::to_string(tenths % 10)
                               : std::to_string((tenths + 9) / 10);
  return "depth along the beam within " + text + " mm";
}

bool disagrees(std::size_t view, std::span<const ViewValue> values) {
  const WellExplained& least =
      values[view].in_silhouette ? kWellExplainedInSilhouettes : kWellExplained;
  return is_far_below_others(view, values, &ViewValue::coarse, least.coarse) ||
         is_far_below_others(view, values, &ViewValue::fine, least.fine);
}

double mean_background(std::span<const ViewValue> values) {
  std::vector<double> backgrounds;
  for (const ViewValue& value : values)
    if (std::isfinite(value.fine)) backgrounds.push_back(value.background);
  return mean_of(backgrounds);
}

double explained_excess(std::span<const ViewValue> values) {
  double sum_of_inverses = 0.0;
  bool has_blind_view = false;
  int count = 0;
  for (const ViewValue& value : values) {
    if (!std::isfinite(value.fine)) continue;
    const double excess = value.fine - value.background;
    if (!std::isfinite(excess)) return std::nan("");
    has_blind_view = has_blind_view || excess <= 0.0;
    sum_of_inverses += 1.0 / excess;
    ++count;
  }
  if (count == 0) return std::nan("");
  return has_blind_view ? 0.0 : count / sum_of_inverses;
}

ViewSummary summary_of(std::span<const ViewValue> values, double ViewValue::*value) {
  ViewSummary summary = {0.0, std::nan("")};
  int count = 0;
  for (const ViewValue& view : values) {
    if (!std::isfinite(view.*value)) continue;
    summary.mean += view.*value;
    ++count;
    summary.lowest = std::fmin(summary.lowest, view.*value);
  }
  summary.mean = count > 0 ? summary.mean / count : std::nan("");
  return summary;
}

JudgeSummary judge_summary(std::span<const ViewValue> values) {
  return {summary_of(values, &ViewValue::coarse),
          summary_of(values, &ViewValue::fine),
          mean_background(values),
          explained_excess(values)};
}

}  // namespace af::registration
