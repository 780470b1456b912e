// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <string>

namespace af {

/// What unfinished work is valid for: every option and input that decides its results.
using DecidingValues = std::map<std::string, std::string>;

/// InputError that names every difference between what earlier work in `folder` was begun with and
/// what is asked for now.
void require_same(const DecidingValues& earlier,
                  const DecidingValues& now,
                  const std::filesystem::path& folder);

}  // namespace af
