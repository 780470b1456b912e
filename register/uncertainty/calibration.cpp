// SPDX-License-Identifier: Apache-2.0
#include "register/uncertainty/calibration.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace af::registration {
namespace {

/// exp(at_once + growth x): x is the logarithm of 1 / (fine share of the gradients explained).
struct InflationRow {
  const char* similarity;
  double at_once;
  double growth;
};

/// By `jobs/uncertainty.sh`, on its odd cases. The last row is for measures that were not fitted.
constexpr std::array kInflation = {
    InflationRow{"rg", 0.0, 0.0},
    InflationRow{"gc", 0.0, 0.0},
    InflationRow{"", 0.0, 0.0},
};

/// Of success_confidence(), likewise fitted.
constexpr double kConfidenceAtOnce = -5.0;
constexpr double kConfidenceByCoarse = 10.0;
constexpr double kConfidenceByFine = 10.0;
constexpr double kConfidenceByTre = -1.0;
constexpr double kConfidenceByChains = -1.0;

/// Shares below are as good as none.
constexpr double kLeastShare = 0.05;
/// A TRE that is not foretold, and the farthest that tells more than the one before.
constexpr double kFarMm = 20.0;

}  // namespace

double covariance_inflation(const std::string& similarity, std::span<const ViewValue> view_values) {
  const double share = summary_of(view_values, &ViewValue::fine).mean;
  if (!std::isfinite(share)) return share;
  const auto* const row = std::find_if(
      kInflation.begin(), kInflation.end() - 1, [&](const InflationRow& candidate) {
        return similarity == candidate.similarity;
      });
  return std::exp(row->at_once - row->growth * std::log(std::clamp(share, kLeastShare, 1.0)));
}

double success_confidence(const ConfidenceFeatures& features) {
  const ViewSummary coarse = summary_of(features.view_values, &ViewValue::coarse);
  const ViewSummary fine = summary_of(features.view_values, &ViewValue::fine);
  const double tre_mm =
      std::isfinite(features.tre_rms_mm) ? std::min(features.tre_rms_mm, kFarMm) : kFarMm;
  const double chains_mm = std::isfinite(features.chain_distance_mm)
                               ? std::min(features.chain_distance_mm, kFarMm)
                               : 0.0;
  const double logit = kConfidenceAtOnce + kConfidenceByCoarse * coarse.lowest +
                       kConfidenceByFine * fine.lowest + kConfidenceByTre * std::log1p(tre_mm) +
                       kConfidenceByChains * std::log1p(chains_mm);
  return 1.0 / (1.0 + std::exp(-logit));
}

}  // namespace af::registration
