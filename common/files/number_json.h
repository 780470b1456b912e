// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>

namespace af {

/// null for NaN, and "inf" for infinity, because JSON has neither.
nlohmann::json number_json(double value);
/// The inverse; NaN for null.
double number_of(const nlohmann::json& value);

}  // namespace af
