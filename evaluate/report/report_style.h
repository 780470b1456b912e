// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

namespace af::evaluation {

/// The report's style sheet, report.css.
std::string_view report_style();

/// report.js, the script that sorts the report's tables.
std::string_view report_script();

}  // namespace af::evaluation
