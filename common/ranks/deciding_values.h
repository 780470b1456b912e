// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <variant>
#include <vector>

#include "files/options_toml.h"
#include "ranks/input_identity.h"

namespace af {

/// Texts must be equal. A CT, and three numbers that may follow from its grid, are compared to
/// kSamePlaceMm, because a CT's files differ in their last digits.
using DecidingValue = std::variant<std::string, Eigen::Vector3d, CtIdentity>;

/// What unfinished work is valid for: every option and input that decides its results.
using DecidingValues = std::map<std::string, DecidingValue>;

/// What decides every result of a run: deciding_options(), the identities of its inputs, this
/// program's version and the beginning of its file's SHA-256. The latter is there because another
/// build may compute something else.
DecidingValues deciding_values(const OptionTexts& options, const InputIdentities& inputs);

/// Every difference between what earlier work was begun with and what is asked for now.
std::vector<std::string> differences(const DecidingValues& earlier, const DecidingValues& now);

nlohmann::json to_json(const DecidingValues& values);

/// The reverse of to_json(). Throws nlohmann's exceptions.
DecidingValues deciding_values_of(const nlohmann::json& json);

}  // namespace af
