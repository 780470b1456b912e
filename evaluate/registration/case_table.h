// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>

#include "files/csv_table.h"

namespace af::evaluation {

/// The paper's Table II, cases.csv, from the "renderers" of summary.json: a row per method and
/// case, and one over all cases ("all"). Errors are in mm. `error` is
/// RegistrationRow::decisive_mm(), by which success is counted. `depth` is for one view, otherwise
/// nan. Failures appear in rates and in the last columns.
CsvTable case_table(const nlohmann::json& renderers);

/// starts-per-interval.csv: how the starts of every case and interval were drawn, from the "cases"
/// and "renderers" of summary.json. nan where that is unknown (starts that another run drew).
CsvTable drawn_starts_table(const nlohmann::json& cases, const nlohmann::json& renderers);

}  // namespace af::evaluation
