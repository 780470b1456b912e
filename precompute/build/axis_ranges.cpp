// SPDX-License-Identifier: Apache-2.0
#include "precompute/build/axis_ranges.h"

#include <optional>
#include <sstream>

#include "base/error.h"
#include "base/parsed_number.h"

namespace af {

namespace {

struct Bounds {
  double low = 0.0;
  double high = 0.0;
};

std::optional<Bounds> bounds_of(std::string_view text) {
  const std::size_t colon = text.find(':');
  const auto first = finite_number(text.substr(0, colon));
  if (!first) return std::nullopt;
  if (colon == std::string_view::npos) {
    if (*first < 0.0) return std::nullopt;
    return Bounds{-*first, *first};
  }
  const auto second = finite_number(text.substr(colon + 1));
  if (!second || *second < *first) return std::nullopt;
  return Bounds{*first, *second};
}

}  // namespace

AxisRanges axis_ranges(const std::string& option,
                       const std::string& text,
                       char letter,
                       double otherwise) {
  AxisRanges ranges;
  ranges.low.fill(-otherwise);
  ranges.high.fill(otherwise);
  const auto refuse = [&](const std::string& part, const std::string& why) {
    throw UsageError(option + " " + text + ": " + (part.empty() ? "" : "'" + part + "' ") + why);
  };
  const std::string axes = std::string("the axes are ") + letter + "x, " + letter + "y and " +
                           letter + "z, each once, as " + letter + "x=-15:15 or " + letter + "x=15";
  std::array<bool, 3> is_named{};
  std::istringstream parts(text);
  for (std::string part; std::getline(parts, part, ',');) {
    const std::string_view view = part;
    const std::size_t axis = view.size() > 3 && view[0] == letter && view[2] == '='
                                 ? std::string_view("xyz").find(view[1])
                                 : std::string_view::npos;
    if (axis == std::string_view::npos || is_named[axis])
      refuse(part, "is not understood: " + axes);
    const auto bounds = bounds_of(view.substr(3));
    if (!bounds) refuse(part, "needs two ascending numbers, LOW:HIGH, or one that is not negative");
    is_named[axis] = true;
    ranges.low[axis] = bounds->low;
    ranges.high[axis] = bounds->high;
  }
  if (text.ends_with(',')) refuse("", "ends with a comma");
  return ranges;
}

}  // namespace af
