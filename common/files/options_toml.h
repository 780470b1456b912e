// SPDX-License-Identifier: Apache-2.0
// What outputs record of a self-describing option struct (base/described_fields.h).
#pragma once

#include <map>
#include <string>

#include "base/described_fields.h"

namespace af {

/// A TOML float that reads back to the same double.
std::string toml_float(double value);

/// TOML values of options by their names.
using OptionTexts = std::map<std::string, std::string>;

/// Lines "name = value" of the recorded fields, in the order of the description. Fields that were
/// not given are left out. Numbers read back to the same bits.
std::string toml_of_fields(const Fields& fields);

/// The fields that decide results, or one stage of them.
OptionTexts deciding_fields(const Fields& fields, const std::string& stage);

/// The options with the values that follow from others filled in, if the struct has in_force().
template <Described T>
T options_in_force(const T& options) {
  if constexpr (requires { options.in_force(); })
    return options.in_force();
  else
    return options;
}

/// The options in force as TOML.
template <Described T>
std::string to_toml(const T& options) {
  T in_force = options_in_force(options);
  return toml_of_fields(fields_of(in_force));
}

/// Name and TOML value of every option in force that decides results, or that decides `stage` of
/// them. Unfinished work is valid for these. Inputs are left out, because their contents decide.
template <Described T>
OptionTexts deciding_options(const T& options, const std::string& stage = "") {
  T in_force = options_in_force(options);
  return deciding_fields(fields_of(in_force), stage);
}

/// The values in a text of "name = value" lines. A list may continue over several lines. Comments
/// are left out.
OptionTexts option_texts(const std::string& toml);

}  // namespace af
