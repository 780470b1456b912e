// SPDX-License-Identifier: Apache-2.0
#include "evaluate/report/number_html.h"

#include <cmath>
#include <iomanip>
#include <limits>
#include <sstream>

#include "base/error.h"
#include "text/number_json.h"

namespace af::evaluation {

using nlohmann::json;

namespace {

std::string fixed(double value, int count) {
  std::ostringstream out;
  out << std::fixed << std::setprecision(count) << value;
  return out.str();
}

}  // namespace

std::string decimals(const json& value, int count) {
  if (value == "inf") return "∞";
  if (!value.is_number()) return "–";
  return fixed(value.get<double>(), count);
}

std::string plain(const json& value) {
  return value.is_number() ? value.dump() : "–";
}

std::int64_t count_of(const json& value) {
  constexpr std::uint64_t kMost = std::numeric_limits<std::int64_t>::max();
  const bool is_count = value.is_number_integer() && value >= 0 &&
                        (!value.is_number_unsigned() || value.get<std::uint64_t>() <= kMost);
  if (!is_count)
    throw FileError("summary.json of a run", "a count", "a whole number", plain(value));
  return value.get<std::int64_t>();
}

std::string percent(double share) {
  const double value = 100 * share;
  const bool would_mislead = (value > 0 && value < 0.5) || (value < 100 && value >= 99.5);
  return fixed(value, would_mislead ? 1 : 0) + "\u00a0%";
}

std::string interval_text(const json& proportion) {
  return fixed(100 * proportion.at("wilson_low").get<double>(), 0) + "–" +
         fixed(100 * proportion.at("wilson_high").get<double>(), 0) + "\u00a0%";
}

std::string rate_with_interval(const json& proportion) {
  if (!proportion.at("rate").is_number()) return "–";
  return percent(proportion.at("rate").get<double>()) + " (" + interval_text(proportion) + ")";
}

std::string capture_text(const nlohmann::json& range) {
  if (!range.is_object() || number_of(range.at("initial_tre_mm")) == 0.0) return "none";
  return std::string(range.at("is_whole_study").get<bool>() ? "at least " : "") +
         decimals(range.at("initial_tre_mm"), 1) + " mm";
}

std::string seconds_text(double seconds) {
  if (!std::isfinite(seconds)) return "–";
  if (seconds < 0.1) return fixed(1000 * seconds, seconds < 0.01 ? 1 : 0) + " ms";
  return fixed(seconds, seconds < 10 ? 2 : seconds < 100 ? 1 : 0) + " s";
}

std::string counted(std::int64_t count, const std::string& singular, const std::string& plural) {
  return std::to_string(count) + " " + (count == 1 ? singular : plural);
}

}  // namespace af::evaluation
