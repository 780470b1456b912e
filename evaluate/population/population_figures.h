// SPDX-License-Identifier: Apache-2.0
// The figures of a study of many patients.
#pragma once

#include <filesystem>
#include <vector>

#include "evaluate/population/population_tables.h"

namespace af::evaluation {

/// Success against the initial error: a panel per variant and views, a line per preset. Conditions
/// by a second renderer, and without a name VARIANT-VIEWS-PRESET, are left out.
/// \param path without extension
void draw_population_success(const std::vector<PopulationGroup>& groups,
                             const PopulationCounting& counting,
                             const std::filesystem::path& path);

/// Every patient's own capture range: a row per condition, a mark per patient.
/// \param path without extension
void draw_capture_ranges(const std::vector<PopulationGroup>& groups,
                         const PopulationCounting& counting,
                         const std::filesystem::path& path);

}  // namespace af::evaluation
