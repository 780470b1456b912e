// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "precompute/design/design_search.h"
#include "precompute/field_parts.h"
#include "precompute/precompute_run.h"

namespace af {

/// A design and why it was chosen.
struct DesignChoice {
  ChosenDesign chosen;
  std::string asked;     ///< "at least 50 dB, at most 8 MB"
  double seconds = 0.0;  ///< how long the probe took
};

/// Collective. Chooses what the options leave open of the design, if anything, by a probe of the
/// CT. All members of an atlas get one design, which suits one of them. The choice is the same on
/// every rank and on any number of them. `parts`: with the resampled CT. Throws as search_design()
/// does.
std::optional<DesignChoice> chosen_design(const std::vector<FieldPart>& parts,
                                          const PrecomputeOptions& options,
                                          PrecomputeRun& run);

}  // namespace af
