// SPDX-License-Identifier: Apache-2.0
#include "register/verdict/verdict.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/sample_summary.h"

namespace af::registration {
namespace {

/// With two decimals, 0 or more: "0.05".
std::string value_text(double value) {
  const std::string hundredths = std::to_string(std::lround(100.0 * std::max(0.0, value)) + 1000);
  return hundredths.substr(1, 1) + "." + hundredths.substr(2);
}

/// "0.05 of 1 (right poses have 0.08 or more)"
std::string share_text(double value, double limit) {
  return value_text(value) + " of 1 (right poses have " + value_text(limit) + " or more)";
}

/// Why the stop reason makes an end doubtful, even if no view does.
std::optional<std::string> doubt_of(StopReason stop_reason, const std::string& pinned_along) {
  switch (stop_reason) {
    case StopReason::PinnedAtLimit:
      return (pinned_along.empty() ? "the search ended at the limit of the field"
                                   : "the field's range ends here along " + pinned_along) +
             ": the optimum may lie outside";
    case StopReason::EvaluationBudgetSpent:
      return "the search was not finished: --max-evaluations is spent";
    default:
      return std::nullopt;
  }
}

/// Why there is no end at all.
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

Judgement judged_values(const ViewSummary& coarse,
                        const ViewSummary& fine,
                        const VerdictLimits& limits) {
  const std::string too_little =
      "on average the pose explains too little of the X-rays' gradients: ";
  if (coarse.mean < limits.coarse_mean)
    return {Verdict::NotFound, too_little + share_text(coarse.mean, limits.coarse_mean)};
  if (fine.mean < limits.fine_mean)
    return {Verdict::NotFound, too_little + share_text(fine.mean, limits.fine_mean) + " in detail"};
  const std::string little = "the pose explains little of an X-ray's gradients: ";
  if (coarse.lowest < limits.coarse_of_found)
    return {Verdict::Doubtful, little + share_text(coarse.lowest, limits.coarse_of_found)};
  if (fine.lowest < limits.fine_of_found)
    return {Verdict::Doubtful,
            little + value_text(fine.lowest) + " of 1 in detail (" +
                value_text(limits.fine_of_found) + " or more leaves no doubt)"};
  return {Verdict::Found,
          "the pose explains at least " + value_text(coarse.lowest) +
              " (of 1) of each X-ray's gradients, and at least " + value_text(fine.lowest) +
              " in detail"};
}

/// "X-ray 2 of 2 cannot be judged: ..."; nothing where every view has both values.
std::optional<std::string> unjudged_view(std::span<const ViewValue> values) {
  for (std::size_t i = 0; i < values.size(); ++i)
    if (!std::isfinite(values[i].coarse) || !std::isfinite(values[i].fine))
      return "X-ray " + std::to_string(i + 1) + " of " + std::to_string(values.size()) +
             " cannot be judged: it shows no gradients over most of twice the region";
  return std::nullopt;
}

bool is_far_below_others(std::size_t view,
                         std::span<const ViewValue> values,
                         double ViewValue::*value,
                         double least_of_found) {
  double highest = 0.0;
  for (std::size_t i = 0; i < values.size(); ++i)
    if (i != view && values[i].*value > highest) highest = values[i].*value;
  return highest >= least_of_found &&
         values[view].*value < std::min(least_of_found, kLeastShareOfOthers * highest);
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

Judgement judged_end(StopReason stop_reason,
                     std::span<const ViewValue> values,
                     const std::string& pinned_along) {
  if (const auto failure = failure_of(stop_reason); failure.has_value())
    return {Verdict::NotFound, *failure};
  const ViewSummary coarse = summary_of(values, &ViewValue::coarse);
  const ViewSummary fine = summary_of(values, &ViewValue::fine);
  auto doubt = doubt_of(stop_reason, pinned_along);
  if (!std::isfinite(coarse.mean) || !std::isfinite(fine.mean))
    return {Verdict::Doubtful, doubt.value_or("no X-ray has gradients to judge the pose by")};
  if (!doubt.has_value()) doubt = unjudged_view(values);
  Judgement judgement = judged_values(coarse, fine, limits_of(values));
  if (!doubt.has_value()) return judgement;
  if (judgement.verdict == Verdict::Found) return {Verdict::Doubtful, *doubt};
  return {judgement.verdict, judgement.reason + "; " + *doubt};
}

std::string depth_text(double depth_95_mm) {
  if (!std::isfinite(depth_95_mm)) return "depth along the beam not known";
  const auto tenths = static_cast<std::int64_t>(std::ceil(10.0 * depth_95_mm));
  const std::string text = tenths < 100
                               ? std::to_string(tenths / 10) + "." + std::to_string(tenths % 10)
                               : std::to_string((tenths + 9) / 10);
  return "depth along the beam within " + text + " mm";
}

const VerdictLimits& limits_of(std::span<const ViewValue> values) {
  const bool in_silhouette = !values.empty() && values.front().in_silhouette;
  return in_silhouette ? kSilhouetteLimits : kRegionLimits;
}

bool disagrees(std::size_t view, std::span<const ViewValue> values) {
  const VerdictLimits& limits = limits_of(values);
  return is_far_below_others(view, values, &ViewValue::coarse, limits.coarse_of_found) ||
         is_far_below_others(view, values, &ViewValue::fine, limits.fine_of_found);
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
