// SPDX-License-Identifier: Apache-2.0
#include "study/ct_keys.h"

#include <algorithm>
#include <set>
#include <stdexcept>
#include <variant>
#include <vector>

#include "base/error.h"
#include "base/joined.h"
#include "files/options_toml.h"
#include "files/toml_reader.h"

namespace af {

namespace {

constexpr const char* kPrefix = "ct_";

/// Sets a field from its key, if the key is there.
struct SetFromKey {
  TomlTableReader& reader;
  std::string key;

  void operator()(bool* value) const {
    if (!reader.has(key.c_str())) return;
    if (const auto found = reader.node(key.c_str()).value_exact<bool>())
      *value = *found;
    else
      reader.add_problem(key.c_str(), "must be true or false");
  }
  void operator()(double* value) const {
    if (const auto found = reader.get_number(key.c_str(), Presence::Optional)) *value = *found;
  }
  void operator()(std::string* value) const {
    if (const auto found = reader.get_string(key.c_str(), Presence::Optional)) *value = *found;
  }
  void operator()(std::vector<std::string>* values) const {
    if (!reader.has(key.c_str())) return;
    const toml::array* const list = reader.node(key.c_str()).as_array();
    if (list != nullptr)
      for (const toml::node& element : *list)
        if (const auto text = element.value_exact<std::string>()) values->push_back(*text);
    if (list == nullptr || list->empty() || values->size() != list->size())
      reader.add_problem(key.c_str(), "must be a list of texts in quotes");
  }
  template <typename Other>
  void operator()(Other* /*value*/) const {
    throw_not_readable();
  }

 private:
  [[noreturn]] void throw_not_readable() const {
    check(false, "CtReadOptions have a type that studies cannot hold");
    throw std::logic_error(key);
  }
};

}  // namespace

CtReadOptions read_ct_keys(TomlTableReader& reader) {
  CtReadOptions reading;
  const Fields fields = fields_of(reading);
  std::string first_key;
  for (const Field& field : fields) {
    const std::string key = kPrefix + field.name;
    std::visit(SetFromKey{reader, key}, field.value);
    if (first_key.empty() && reader.has(key.c_str())) first_key = key;
    if (!field.choices.empty() && reader.has(key.c_str())) {
      const auto text = reader.get_string(key.c_str(), Presence::Optional);
      if (text &&
          std::find(field.choices.begin(), field.choices.end(), *text) == field.choices.end())
        reader.add_problem(key.c_str(), "must be one of " + joined(field.choices));
    }
  }
  if (first_key.empty()) return reading;
  for (const std::string& problem : problems(reading))
    reader.add_problem(first_key.c_str(), kPrefix + problem);
  return reading;
}

namespace {

/// The options that differ from the default.
OptionTexts stated_texts(const CtReadOptions& reading) {
  const OptionTexts usual = option_texts(to_toml(CtReadOptions()));
  OptionTexts stated;
  for (const auto& [name, value] : option_texts(to_toml(reading))) {
    const auto found = usual.find(name);
    if (found == usual.end() || found->second != value) stated[name] = value;
  }
  return stated;
}

/// The texts that are CtReadOptions, as keys of a study.
std::string keys_of(const OptionTexts& texts) {
  std::set<std::string> names;
  CtReadOptions reading;
  for (const Field& field : fields_of(reading)) names.insert(field.name);
  std::string text;
  for (const auto& [name, value] : texts)
    if (names.contains(name))
      text += std::string(kPrefix).append(name).append(" = ").append(value).append("\n");
  return text;
}

}  // namespace

std::string ct_keys_text(const CtReadOptions& reading) {
  return keys_of(stated_texts(reading));
}

CtReadOptions ct_reading_of(const std::string& options_toml) {
  try {
    const std::string place = "options of the field";
    const toml::table table = parse_toml("# CT\n" + keys_of(option_texts(options_toml)), place);
    TomlProblems problems(place);
    TomlTableReader reader(table, "", problems);
    return read_ct_keys(reader);
  } catch (const Error&) {
    return {};
  }
}

}  // namespace af
