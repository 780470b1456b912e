// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

namespace af::evaluation {

/// A number of a summary with fixed decimals; "–" for what does not exist, "∞" for infinity.
std::string decimals(const nlohmann::json& value, int count);

/// A number as it stands in a summary; "–" for anything else.
std::string plain(const nlohmann::json& value);

/// A count of a summary; FileError unless it is a whole number of at least 0.
std::int64_t count_of(const nlohmann::json& value);

/// A share as "91 %"; one decimal where whole per cents would round to 0 or 100 falsely.
std::string percent(double share);

/// The 95 % interval of a proportion of a summary: "76–97 %".
std::string interval_text(const nlohmann::json& proportion);

/// A proportion of a summary: "91 % (76–97 %)", the brackets holding the 95 % interval.
std::string rate_with_interval(const nlohmann::json& proportion);

/// A capture range of a summary: "12 mm", "at least 16 mm" where the study ends it, "none".
std::string capture_text(const nlohmann::json& range);

/// Seconds as "42.6 s", "0.20 s", "8.4 ms".
std::string seconds_text(double seconds);

/// "1 start", "3 starts".
std::string counted(std::int64_t count, const std::string& singular, const std::string& plural);

}  // namespace af::evaluation
