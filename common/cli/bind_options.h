// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/described_fields.h"
#include "cli/app_forward.h"

namespace af::cli {

/// Adds an option for every field that has one.
void bind_fields(CLI::App& app, const Fields& fields);

/// The description from which an option of this command, or group of options, was made. Null when
/// it was made without one. It lives as long as the program.
const Field* bound_field(const CLI::App& app, const CLI::Option& option);

/// Binds the options of a struct that describes itself. `options` must outlive the parsing.
template <Described T>
void bind_options(CLI::App& app, T& options) {
  bind_fields(app, fields_of(options));
}

}  // namespace af::cli
