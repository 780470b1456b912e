// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <vector>

#include "precompute/design/design_budget.h"
#include "precompute/design/design_model.h"

namespace af {

/// Where a search may go.
struct SearchSpace {
  DesignParts fixed;    ///< parts that are stated
  int most_slabs = 12;  ///< slices of the CT that attenuate
};

/// Measures designs of these slabs and nodes: points for look-ups and codebooks that may be chosen.
using MeasureDesign = std::function<std::vector<DesignPoint>(const FieldDesign& design)>;

struct ChosenDesign {
  DesignForecast forecast;
  std::vector<DesignForecast>
      measured;  ///< the designs that the probe measured, in order, by the choice's look-up
  DesignForecast
      runner_up;  ///< the best of another number of slabs, by the model; slabs 0: there is none
};

/// The best design within a budget. With a PSNR to reach, the smallest file, and of files within a
/// few percent of it the fastest DRR; else the highest PSNR, and of designs within a fifth of a
/// decibel the fastest DRR. It measures a first guess, tells all others by the model, measures the
/// best of them, and so on until the best is one that is (almost) measured. InputError, naming the
/// best that can be had, when nothing fits. \test DesignSearch.*
ChosenDesign search_design(const DesignBudget& budget,
                           const SearchSpace& space,
                           const MeasureDesign& measure);

}  // namespace af
