// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

namespace af {

/// Converts to the type of any member that option structs have.
struct AnyMember {
  template <typename T>
  operator T() const;  // NOLINT(google-explicit-constructor)
  // std::optional<T> can also be made from anything that converts to T. These conversions win over
  // that one because they are not templates.
  operator std::optional<int>() const;                    // NOLINT(google-explicit-constructor)
  operator std::optional<std::int64_t>() const;           // NOLINT(google-explicit-constructor)
  operator std::optional<double>() const;                 // NOLINT(google-explicit-constructor)
  operator std::optional<std::string>() const;            // NOLINT(google-explicit-constructor)
  operator std::optional<std::array<double, 3>>() const;  // NOLINT(google-explicit-constructor)
};

/// Members of an aggregate; a base class counts as one.
template <typename T, typename... Members>
constexpr int field_count() {
  if constexpr (requires { T{Members{}..., AnyMember{}}; })
    return field_count<T, Members..., AnyMember>();
  else
    return static_cast<int>(sizeof...(Members));
}

}  // namespace af
