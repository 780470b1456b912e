// SPDX-License-Identifier: Apache-2.0
#include "register/method/chain_text.h"

#include <charconv>
#include <sstream>
#include <variant>

#include "base/error.h"
#include "base/joined.h"
#include "base/number_text.h"

namespace af::registration {
namespace {

template <typename Number>
bool parse(const std::string& text, Number& value) {
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  return error == std::errc() && stop == end;
}

/// A number of a stage; stages have int and double ones only.
template <typename Visitor>
auto visit_number(const Field& field, const Visitor& visitor) {
  if (int* const* const whole = std::get_if<int*>(&field.value)) return visitor(**whole);
  return visitor(*std::get<double*>(field.value));
}

/// As it is typed in a chain.
std::string key_of(const Field& field) {
  return field.option.substr(field.option.find_first_not_of('-'));
}

bool set_key(StageOptions& stage, const std::string& key, const std::string& value) {
  for (const Field& field : fields_of(stage))
    if (key == key_of(field))
      return visit_number(field, [&](auto& number) { return parse(value, number); });
  return false;
}

StageOptions stage_from_text(const std::string& text) {
  StageOptions stage;
  std::istringstream words(text);
  if (!(words >> stage.similarity.name >> stage.optimizer))
    throw InputError("chain", "'" + text + "'", "a stage begins with a measure and an optimiser");
  for (std::string word; words >> word;) {
    const std::size_t equals = word.find('=');
    if (equals == std::string::npos ||
        !set_key(stage, word.substr(0, equals), word.substr(equals + 1)))
      throw InputError("chain",
                       "'" + word + "'",
                       "must be KEY=NUMBER with one of " + joined(fields_of(stage), ", ", key_of));
  }
  return stage;
}

}  // namespace

std::string stage_text(const StageOptions& stage) {
  StageOptions mine = stage;
  StageOptions plain;
  const Fields defaults = fields_of(plain);
  std::string text = stage.similarity.name + " " + stage.optimizer;
  auto default_field = defaults.begin();
  for (const Field& field : fields_of(mine)) {
    const auto text_of = [](const auto& number) { return number_text(number); };
    const std::string value = visit_number(field, text_of);
    if (value != visit_number(*default_field++, text_of)) text += " " + key_of(field) + "=" + value;
  }
  return text;
}

std::string chain_keys_help() {
  StageOptions stage;
  return joined(
      fields_of(stage), "; ", [](const Field& field) { return key_of(field) + "= " + field.help; });
}

std::string chain_text(const ChainOptions& chain) {
  return joined(chain.stages, "; ", stage_text);
}

ChainOptions chain_from_text(const std::string& name, const std::string& text) {
  ChainOptions chain{name, {}};
  std::istringstream stages(text);
  for (std::string stage; std::getline(stages, stage, ';');)
    chain.stages.push_back(stage_from_text(stage));
  return chain;
}

}  // namespace af::registration
