// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <variant>

#include "ct/ct_identity.h"

namespace af {

/// What distinguishes an input of a run: its SHA-256, or a CT's identity.
using InputIdentity = std::variant<std::string, CtIdentity>;
using InputIdentities = std::map<std::string, InputIdentity>;  ///< by name or path

nlohmann::json to_json(const CtGrid& grid);
nlohmann::json to_json(const CtIdentity& ct);

/// The reverse of to_json(). Throws nlohmann's exceptions.
CtIdentity ct_identity_of(const nlohmann::json& json);

}  // namespace af
