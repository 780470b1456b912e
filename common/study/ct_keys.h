// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "ct/ct_read_options.h"

namespace af {

class TomlTableReader;

/// Reads the keys of a [[case]] that say how its CT is read: "ct_" and the names of CtReadOptions,
/// such as ct_resample. Problems become problems of `reader`.
CtReadOptions read_ct_keys(TomlTableReader& reader);

/// The keys that differ from their defaults, one per line.
std::string ct_keys_text(const CtReadOptions& reading);

/// How a CT was read, according to the options that a field records.
CtReadOptions ct_reading_of(const std::string& options_toml);

}  // namespace af
