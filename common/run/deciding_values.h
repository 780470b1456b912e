// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <vector>

namespace af {

/// What unfinished work is valid for: every option and input that decides its results.
using DecidingValues = std::map<std::string, std::string>;

/// What decides every result of a run: deciding_options(), the inputs' SHA-256 by name, and this
/// program's version and the beginning of its file's SHA-256: another build may compute something
/// else.
DecidingValues deciding_values(DecidingValues options,
                               const std::map<std::string, std::string>& input_sha256);

/// Every difference between what earlier work was begun with and what is asked for now.
std::vector<std::string> differences(const DecidingValues& earlier, const DecidingValues& now);

}  // namespace af
