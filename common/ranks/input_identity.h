// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <variant>

#include "ct/ct_identity.h"

namespace af {

/// What tells an input of a run from another: its SHA-256, or what a CT is.
using InputIdentity = std::variant<std::string, CtIdentity>;
using InputIdentities = std::map<std::string, InputIdentity>;  ///< by name or path

nlohmann::json to_json(const CtGrid& grid);
nlohmann::json to_json(const CtIdentity& ct);

/// Of what to_json() made. Throws nlohmann's exceptions.
CtIdentity ct_identity_of(const nlohmann::json& json);

}  // namespace af
