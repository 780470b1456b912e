// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

namespace af {

/// A value as CBOR: doubles keep every bit, NaN and infinity.
std::vector<std::byte> cbor_bytes(const nlohmann::json& value);

/// The value of CBOR bytes from a file. FileError naming `file` when the bytes are not CBOR, or
/// nest deeper than 16 levels: the library's reader is recursive, so that deep nesting would
/// exhaust the stack.
/// \test CborJson.RefusesWhatIsNestedTooDeeply
nlohmann::json json_of_cbor(std::span<const std::byte> bytes, const std::string& file);

}  // namespace af
