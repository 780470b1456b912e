// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace af {

/// The value of a JSON text from `file`. Throws FileError naming the file when the text is not
/// JSON, or nests deeper than 64 levels: copying, comparing and writing a value are recursive, so
/// deep nesting would exhaust the stack.
/// \test JsonText.RefusesWhatIsNestedTooDeeply
nlohmann::json json_of_text(const std::string& text, const std::string& file);

/// The same with the keys in the order of the text.
nlohmann::ordered_json ordered_json_of_text(const std::string& text, const std::string& file);

}  // namespace af
