// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "evaluate/image_quality/drr_comparison.h"
#include "field/compressed_attenuation_field.h"
#include "files/csv_cells.h"
#include "geometry/camera_distance.h"

namespace af::evaluation {

/// image-quality.csv: one row per pose, in order, after the columns that name the target. No
/// timings.
std::vector<CsvCells> image_quality_rows(const std::vector<DrrComparison>& comparisons,
                                         const CsvCells& target = {});

/// Index of the comparison at `share` of the ascending PSNRs (0: the worst). nullopt when none was
/// possible. Ties go to the lower index.
std::optional<std::size_t> comparison_at(const std::vector<DrrComparison>& comparisons,
                                         double share);

/// Counts and statistics of summary.json.
nlohmann::json image_quality_statistics(const std::vector<DrrComparison>& comparisons);

/// How far the camera in use is from the field's, and the poses that the field covers for it.
nlohmann::json camera_distance_json(const CameraDistance& distance, const MotionRange& covered);

/// Resolution, range and size of a field, as tables show them. For an atlas, `planes` are those of
/// a member.
nlohmann::json field_description(const FieldIdentity& identity,
                                 const LightSlab& planes,
                                 std::size_t codewords);

}  // namespace af::evaluation
