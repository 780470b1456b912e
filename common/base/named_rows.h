// SPDX-License-Identifier: Apache-2.0
// A family of things that are chosen by name (measures, optimisers, casters, ...) is one array of
// rows, each with a `name`, a `help` and whatever makes it. Options, their help, error texts,
// listings and tests iterate over that array, so an addition is one row.
#pragma once

#include <algorithm>
#include <iterator>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/joined.h"

namespace af {

/// The names of rows, or of cameras, cases and the like.
template <typename Rows>
std::vector<std::string> names_of(const Rows& rows) {
  std::vector<std::string> names;
  names.reserve(std::size(rows));
  for (const auto& row : rows) names.emplace_back(row.name);
  return names;
}

/// "name: help; name: help"
template <typename Rows>
std::string help_of(const Rows& rows) {
  return joined(
      rows, "; ", [](const auto& row) { return std::string(row.name) + ": " + row.help; });
}

/// The row of that name; nullptr when there is none.
template <typename Rows>
auto find_row(const Rows& rows, const std::string& name) {
  const auto found = std::ranges::find_if(rows, [&](const auto& row) { return name == row.name; });
  return found == std::ranges::end(rows) ? nullptr : &*found;
}

/// "field = 'name': must be one of a, b, c"
template <typename Rows>
std::string unknown_name_text(const Rows& rows, const std::string& field, const std::string& name) {
  return field + " = '" + name + "': must be one of " + joined(names_of(rows));
}

/// The row of that name. Throws InputError with the text above when there is none.
template <typename Rows>
const auto& required_row(const Rows& rows, const std::string& field, const std::string& name) {
  const auto* const row = find_row(rows, name);
  if (row == nullptr) throw InputError(unknown_name_text(rows, field, name));
  return *row;
}

}  // namespace af
