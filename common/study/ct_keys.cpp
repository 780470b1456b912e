// SPDX-License-Identifier: Apache-2.0
#include "study/ct_keys.h"

#include <algorithm>
#include <stdexcept>
#include <variant>
#include <vector>

#include "base/error.h"
#include "base/joined.h"
#include "text/options_toml.h"
#include "text/toml_reader.h"

namespace af {

namespace {

constexpr const char* kPrefix = "ct_";

/// Sets a field from its key, where that is there.
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

std::string ct_keys_text(const CtReadOptions& reading) {
  const OptionTexts defaults = option_texts(to_toml(CtReadOptions()));
  std::string text;
  for (const auto& [name, value] : option_texts(to_toml(reading))) {
    const auto usual = defaults.find(name);
    if (usual == defaults.end() || usual->second != value)
      text += std::string(kPrefix).append(name).append(" = ").append(value).append("\n");
  }
  return text;
}

CtReadOptions ct_reading_in_force(const CtReadOptions& typed, const CtReadOptions& of_study) {
  CtReadOptions reading = typed.text().empty() ? of_study : typed;
  reading.series_uid = typed.series_uid.empty() ? of_study.series_uid : typed.series_uid;
  return reading;
}

CtReadOptions ct_reading_of(const std::string& options_toml) {
  // The lines under their names as keys of a study, so that one reader reads both.
  const OptionTexts recorded = option_texts(options_toml);
  std::string text = "# CT\n";
  CtReadOptions names;
  for (const Field& field : fields_of(names))
    if (const auto found = recorded.find(field.name); found != recorded.end())
      text += std::string(kPrefix).append(field.name + " = " + found->second + "\n");
  try {
    const toml::table table = parse_toml(text, "options of the field");
    TomlProblems problems("options of the field");
    TomlTableReader reader(table, "", problems);
    return read_ct_keys(reader);
  } catch (const Error&) {
    return {};
  }
}

}  // namespace af
