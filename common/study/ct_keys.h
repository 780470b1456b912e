// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "ct/ct_read_options.h"

namespace af {

class TomlTableReader;

/// Reads the keys of a [[case]] that say how its CT is read: the names of CtReadOptions behind
/// "ct_", such as ct_resample. Problems become problems of `reader`.
CtReadOptions read_ct_keys(TomlTableReader& reader);

/// The keys that are not as they are by default, one per line.
std::string ct_keys_text(const CtReadOptions& reading);

/// How a CT was read, by the options that a field records.
CtReadOptions ct_reading_of(const std::string& options_toml);

}  // namespace af
