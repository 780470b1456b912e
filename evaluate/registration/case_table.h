// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>

#include "files/csv_table.h"

namespace af::evaluation {

/// The paper's Table II, cases.csv: a row per method and case, and one over all cases ("all"), of
/// the "renderers" of summary.json. Errors in mm (`error`: RegistrationRow::decisive_mm(), which
/// success is by; `depth` of one view, else nan); failures stay in rates and in the last columns.
CsvTable case_table(const nlohmann::json& renderers);

/// starts-per-interval.csv: how the starts of every case and interval were drawn, of the "cases"
/// and "renderers" of summary.json; nan where that is not known (starts that another run drew).
CsvTable drawn_starts_table(const nlohmann::json& cases, const nlohmann::json& renderers);

}  // namespace af::evaluation
