// SPDX-License-Identifier: Apache-2.0
#include "register/uncertainty/calibration.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace af::registration {
namespace {

/// The share of the X-rays' gradients that a pose explains in detail, mean over the views, from
/// which on it explains them well.
constexpr double kExplainedShare = 0.65;

/// exp(at_once + growth x): x is by how much the logarithm of the share falls short of that of
/// kExplainedShare.
struct Inflation {
  double at_once;
  double growth;
};

struct InflationRow {
  const char* similarity;
  bool in_silhouette;
  Inflation pose;
  Inflation tre;
};

/// By `jobs/uncertainty.py`, on patients of odd numbers: the pose's at f8c8d8f, the TREs' at
/// caf419aa; mi's is an earlier fit to cases of one phantom (docs/uncertainty.md). Within
/// silhouettes on drawn bones of odd numbers (44ed6cd2), of which the pose explains nearly all:
/// their growth is that over regions. The last row is for measures that were not fitted: the most
/// cautious of them.
constexpr std::array kInflation = {
    InflationRow{"rg", false, {0.09, 2.95}, {-0.10, 1.05}},
    InflationRow{"gc", false, {0.00, 1.90}, {-0.47, 1.00}},
    InflationRow{"gc", true, {0.79, 1.90}, {0.77, 1.00}},
    InflationRow{"mi", false, {2.50, 8.00}, {2.50, 8.00}},
    InflationRow{"", false, {2.50, 8.00}, {2.50, 8.00}},
};

/// The coefficients of a logistic regression.
struct Confidence {
  double at_once;
  double by_excess;
  double by_log_tre;
};

/// Of success_confidence(), likewise, to the registrations of caf419aa, whose tables have the mean
/// of the views' backgrounds alone (docs/uncertainty.md says how little that matters).
constexpr Confidence kOverRegions{-2.46, 44.41, -0.88};
/// Of drawn bones of odd numbers (44ed6cd2), with the logarithm of the excess.
constexpr Confidence kInSilhouettes{0.62, 4.23, -3.68};
/// A smaller excess counts as this one there: a view that shows nothing leaves no confidence.
constexpr double kLeastExcess = 0.02;

/// Smaller shares are treated as this one.
constexpr double kLeastShare = 0.05;
/// Predicted TREs are clamped to this range, so that a small one does not stand for what X-rays do
/// not show; a missing one counts as the farthest.
constexpr double kNearMm = 0.1;
constexpr double kFarMm = 20.0;

bool are_in_silhouettes(std::span<const ViewValue> view_values) {
  return !view_values.empty() && view_values.front().in_silhouette;
}

double log_of_excess(double excess) {
  return std::isfinite(excess) ? std::log(std::max(excess, kLeastExcess)) : excess;
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
  const bool in_silhouette = are_in_silhouettes(view_values);
  const auto* const row =
      std::find_if(kInflation.begin(), kInflation.end() - 1, [&](const InflationRow& candidate) {
        return similarity == candidate.similarity && in_silhouette == candidate.in_silhouette;
      });
  return {factor_of(row->pose, share), factor_of(row->tre, share)};
}

double success_confidence(const ConfidenceFeatures& features) {
  const double tre_mm = std::isfinite(features.sandwich_tre_mm)
                            ? std::clamp(features.sandwich_tre_mm, kNearMm, kFarMm)
                            : kFarMm;
  const bool in_silhouettes = are_in_silhouettes(features.view_values);
  const Confidence& by = in_silhouettes ? kInSilhouettes : kOverRegions;
  const double excess = explained_excess(features.view_values);
  const double logit = by.at_once +
                       by.by_excess * (in_silhouettes ? log_of_excess(excess) : excess) +
                       by.by_log_tre * std::log(tre_mm);
  return 1.0 / (1.0 + std::exp(-logit));
}

}  // namespace af::registration
