// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <vector>

#include "precompute/design/design_budget.h"
#include "precompute/design/design_model.h"

namespace af {

/// Limits of a search.
struct SearchSpace {
  DesignParts fixed;    ///< parts that are stated
  int most_slabs = 12;  ///< slices of the CT that attenuate
};

/// Measures designs with these slabs and nodes. Gives points for look-ups and codebooks that may be
/// chosen.
using MeasureDesign = std::function<std::vector<DesignPoint>(const FieldDesign& design)>;

struct ChosenDesign {
  DesignForecast forecast;
  std::vector<DesignForecast>
      measured;  ///< the designs that the probe measured, in order, by the choice's look-up
  DesignForecast runner_up;  ///< the best with another number of slabs, by the model; slabs 0: none
};

/// Finds the best design within a budget. With a PSNR to reach, that is the smallest file, or the
/// fastest DRR among files within a few percent of it. Otherwise it is the highest PSNR, or the
/// fastest DRR among designs within a fifth of a decibel. The search measures a first guess,
/// forecasts all other designs by the model, measures the best of them, and repeats until the best
/// is (almost) measured. Throws InputError, naming the best possible design, when none fits. \test
/// DesignSearch.*
ChosenDesign search_design(const DesignBudget& budget,
                           const SearchSpace& space,
                           const MeasureDesign& measure);

}  // namespace af
