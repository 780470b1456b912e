// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "precompute/design/design_budget.h"

namespace af {

/// A design by name: fixed, or chosen by a probe within a budget.
struct DesignPreset {
  const char* name = nullptr;
  const char* help = nullptr;
  FieldDesign design;   ///< fixed, or where a probe must not be made
  DesignBudget budget;  ///< empty: the design is fixed
};

/// The preset of a field when nothing is said about its design.
inline constexpr const char* kDefaultPreset = "standard";
/// The preset of an atlas's fields.
inline constexpr const char* kAtlasPreset = "atlas";
/// The paper's own design, for comparisons.
inline constexpr const char* kPaperPreset = "paper";

/// The preset of that name. Throws InputError for an unknown name.
const DesignPreset& design_preset_named(const std::string& name);

/// Names that design_preset_named() knows, and one line that explains them.
std::vector<std::string> design_preset_names();
std::string design_preset_help();

}  // namespace af
