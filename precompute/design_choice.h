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
  double seconds = 0.0;  ///< that the probe took
};

/// Collective. Chooses what the options leave open of the design, by a probe of the CT, where there
/// is anything: one design for all members of an atlas, by what one needs; the same on every rank
/// and on any number of them. `parts`: with the resampled CT. Errors of search_design().
std::optional<DesignChoice> chosen_design(const std::vector<FieldPart>& parts,
                                          const PrecomputeOptions& options,
                                          PrecomputeRun& run);

}  // namespace af
