// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

namespace af::evaluation {

/// The report's style sheet, report.css.
std::string_view report_style();

/// What makes the report's tables sort, report.js.
std::string_view report_script();

}  // namespace af::evaluation
