// SPDX-License-Identifier: Apache-2.0
#include "register/verdict/calibration.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace af::registration {
namespace {

/// A pose explains the X-rays well from this share of their gradients on, in detail, averaged over
/// the views.
constexpr double kExplainedShare = 0.65;

/// exp(at_once + growth x), where x is how far the logarithm of the share falls short of that of
/// kExplainedShare.
struct Inflation {
  double at_once;
  double growth;
};

/// The kinds of evidence about a pose. Each has constants of its own.
enum class Evidence { Views, OneView, Silhouettes };

struct InflationRow {
  const char* similarity;
  Evidence evidence;
  Inflation pose;
  Inflation tre;
};

/// Fitted by `jobs/uncertainty.py --folds` to patients 1001 to 1060 (a902ce97;
/// docs/uncertainty.md). The row within silhouettes was fitted to drawn bones of odd numbers
/// (44ed6cd2). The pose explains nearly all of these, so their growth is that over regions. The
/// last row is for what was not fitted, and more cautious than all others.
constexpr std::array kInflation = {
    InflationRow{"rg", Evidence::Views, {0.41, 1.75}, {-0.08, 0.90}},
    InflationRow{"gc", Evidence::Views, {0.00, 1.90}, {-0.60, 0.85}},
    InflationRow{"mi", Evidence::Views, {1.72, 0.35}, {1.38, 0.00}},
    InflationRow{"rg", Evidence::OneView, {0.70, 3.15}, {0.49, 0.00}},
    InflationRow{"gc", Evidence::OneView, {0.61, 2.45}, {0.15, 0.00}},
    InflationRow{"mi", Evidence::OneView, {1.66, 0.90}, {0.79, 0.00}},
    InflationRow{"gc", Evidence::Silhouettes, {0.79, 1.90}, {0.77, 1.00}},
    InflationRow{"", Evidence::Views, {2.50, 8.00}, {2.50, 8.00}},
};

/// Share of the samples' spacing. See interpolation_shift_mm() and docs/uncertainty.md.
constexpr double kShiftPerSpacing = 0.02;

/// The coefficients of a logistic regression on two features.
struct Confidence {
  double at_once;
  double by_excess;
  double by_second;
};

/// For success_confidence(), likewise fitted, to the ends of `robust` and `fast`.
constexpr Confidence kOverRegions{-3.10, 51.13, -1.08};
/// For one view, by its excess and the logarithm of the excess's part of the share. A predicted TRE
/// says how little one view shows of depth, not whether the place is right.
constexpr Confidence kOneView{-1.10, 48.14, 3.81};
/// For drawn bones of odd numbers (44ed6cd2), with the logarithm of the excess.
constexpr Confidence kInSilhouettes{0.62, 4.23, -3.68};
/// Smaller excesses count as this one there: a view that shows nothing leaves no confidence.
constexpr double kLeastExcess = 0.02;

/// Smaller shares are treated as this one.
constexpr double kLeastShare = 0.05;
/// Predicted TREs are clamped to this range, so that a small one does not stand for what X-rays do
/// not show. A missing one counts as the farthest.
constexpr double kNearMm = 0.1;
constexpr double kFarMm = 20.0;

Evidence evidence_of(std::span<const ViewValue> view_values) {
  if (!view_values.empty() && view_values.front().in_silhouette) return Evidence::Silhouettes;
  return view_values.size() == 1 ? Evidence::OneView : Evidence::Views;
}

/// NaN stays NaN.
double log_of_at_least(double value, double least) {
  return std::isfinite(value) ? std::log(std::max(value, least)) : value;
}

double factor_of(const Inflation& inflation, double share) {
  if (!std::isfinite(share)) return share;
  const double shortfall = std::log(kExplainedShare / std::clamp(share, kLeastShare, 1.0));
  return std::exp(inflation.at_once + inflation.growth * std::max(0.0, shortfall));
}

}  // namespace

CovarianceInflation covariance_inflation(const std::string& similarity,
                                         std::span<const ViewValue> view_values) {
  const double share = summary_of(view_values, &ViewValue::fine).mean;
  const Evidence evidence = evidence_of(view_values);
  const auto* const row =
      std::find_if(kInflation.begin(), kInflation.end() - 1, [&](const InflationRow& candidate) {
        return similarity == candidate.similarity && evidence == candidate.evidence;
      });
  return {factor_of(row->pose, share), factor_of(row->tre, share)};
}

double interpolation_shift_mm(double spacing_mm) {
  return kShiftPerSpacing * spacing_mm;
}

double success_confidence(const ConfidenceFeatures& features) {
  const double excess = explained_excess(features.view_values);
  const double log_tre = std::log(std::isfinite(features.sandwich_tre_mm)
                                      ? std::clamp(features.sandwich_tre_mm, kNearMm, kFarMm)
                                      : kFarMm);
  const auto by = [](const Confidence& constants, double first, double second) {
    const double logit =
        constants.at_once + constants.by_excess * first + constants.by_second * second;
    return 1.0 / (1.0 + std::exp(-logit));
  };
  switch (evidence_of(features.view_values)) {
    case Evidence::OneView: {
      const double share = std::max(features.view_values.front().fine, kLeastShare);
      return by(kOneView, excess, log_of_at_least(excess / share, kLeastExcess));
    }
    case Evidence::Silhouettes:
      return by(kInSilhouettes, log_of_at_least(excess, kLeastExcess), log_tre);
    default:
      return by(kOverRegions, excess, log_tre);
  }
}

}  // namespace af::registration
