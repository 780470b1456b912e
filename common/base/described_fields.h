// SPDX-License-Identifier: Apache-2.0
// A struct of options describes itself once. The command line (cli/bind_options.h), TOML of the
// options in force and keys of unfinished work (files/options_toml.h) and the check of its values
// (field_problems()) follow from that:
//
//     struct FieldDesign {
//       int uv_nodes = 64;
//       void describe(Fields& field) {
//         field("uv_nodes", uv_nodes, "Viewpoints along each side of the (u,v) plane").at_least(2);
//       }
//     };
#pragma once

#include <array>
#include <concepts>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "base/error.h"
#include "base/field_count.h"

namespace af {

/// Pointer to a field's value. An empty text or list, or an unset optional, was not given.
using FieldValue = std::variant<bool*,
                                int*,
                                std::int64_t*,
                                std::uint64_t*,
                                double*,
                                std::string*,
                                std::filesystem::path*,
                                std::array<double, 2>*,
                                std::array<double, 3>*,
                                std::vector<int>*,
                                std::vector<double>*,
                                std::vector<std::string>*,
                                std::vector<std::filesystem::path>*,
                                std::optional<int>*,
                                std::optional<std::int64_t>*,
                                std::optional<double>*,
                                std::optional<std::string>*,
                                std::optional<std::array<double, 3>>*>;

/// A rule for every number, or every text, of a field.
struct Constraint {
  std::string words;               ///< "between 2 and 4096"
  std::optional<double> low;       ///< smallest number that is accepted, when words say one
  std::optional<double> high;      ///< largest
  std::vector<std::string> names;  ///< all texts that are accepted, when they can be listed
  std::function<bool(double)> accepts_number = [](double) { return true; };
  std::function<bool(const std::string&)> accepts_text = [](const std::string&) { return true; };
};

/// What the paths of a field refer to, for graphical front ends and shell completion.
enum class PathRole {
  Unsaid,
  InputFile,
  InputFolder,
  InputVolume,     ///< a CT
  InputTransform,  ///< a rigid transform that ITK reads
  OutputFile,
  OutputFolder,
  OutputVolume,  ///< an image or a stack of images
};

/// One field of a struct: what it is called, how it is typed, checked and recorded.
struct Field {
  std::string name;  ///< with its unit; key in TOML, and what messages call it
  FieldValue value;
  std::string help;
  std::string option;  ///< names on the command line; empty: no option

  std::vector<Constraint> constraints;  ///< field_problems()
  std::vector<std::string> choices;     ///< the command line refuses others
  std::string group;                    ///< heading of its option in the help
  std::string exactly_one_of;           ///< group of which exactly one option must be given
  std::vector<std::string> excluded;    ///< names of options that must not be given beside it
  std::vector<std::string> needed;      ///< names of options that must be given beside it
  int number_count = 0;                 ///< length of a list; 0: any
  bool is_required = false;
  bool is_checked_when_typed = false;  ///< the command line refuses what breaks a constraint
  bool is_comma_separated = false;
  bool takes_one_at_a_time = false;  ///< for a list: the option is repeated
  bool is_size = false;              ///< "8GB"
  bool is_off_switch = false;        ///< the option makes it false
  bool shows_default = true;
  PathRole path_role = PathRole::Unsaid;
  std::string file_endings;  ///< ".toml", ".mha,.nii.gz"; the first is the usual one

  bool is_recorded = true;
  bool is_deciding = true;      ///< decides results; unfinished work of another value is refused
  std::string stage;            ///< the stage whose results it decides; empty: all
  std::string name_when_unset;  ///< recorded instead ...
  std::string text_when_unset;  ///< ... with this value

  // Constraints; NaN keeps none.
  Field& at_least(double low);
  Field& above(double low);
  Field& at_most(double high);
  Field& within(double low, double high);
  Field& finite();
  Field& one_of(std::vector<std::string> names);
  Field& such_that(std::string words, std::function<bool(double)> accepts);
  Field& of_form(std::string words, std::function<bool(const std::string&)> accepts);

  // The command line.
  Field& as(std::string option_names);
  Field& as(std::string option_names, std::string help_text);
  /// The field has no option. `why` is for readers of the code.
  Field& no_option(const char* why);
  Field& choice(std::vector<std::string> names);
  Field& one_of_group(std::string name);
  Field& excludes(std::vector<std::string> options);
  Field& needs(std::vector<std::string> options);
  Field& count(int numbers);
  Field& required();
  Field& checked_when_typed();
  Field& comma_separated();
  Field& one_at_a_time();
  Field& size();
  Field& off_switch();
  Field& default_in_help();
  Field& stands_for(PathRole role, std::string endings = "");

  // Records. `why` is for readers of the code.
  /// Neither recorded nor deciding.
  Field& not_recorded(const char* why);
  /// Recorded, but unfinished work may continue with another value.
  Field& not_deciding(const char* why);
  /// Names an input file. The checksum of its content decides results, not its name.
  Field& input();
  Field& decides(std::string stage_name);
  /// When the field is not given, `other_name = text` is recorded.
  Field& recorded_when_unset(std::string other_name, std::string text);
};

class Fields;

template <typename T>
concept Described = requires(T options, Fields& fields) {
  options.describe(fields);
};

/// The list of a struct's fields, in the order of its description.
class Fields {
 public:
  template <typename T>
  Field& operator()(const std::string& name, T& value, const std::string& help) {
    ++own_count_;
    return add(name, &value, help);
  }

  /// Lists the fields of a described member or base class as if they were the struct's own.
  template <Described T>
  void part(T& described);

  /// A member that is not an option.
  template <typename T>
  void leave_out(const T& /*member*/, const char* /*why*/) {
    ++own_count_;
  }

  /// Group of the options listed from now on; "" for none.
  void start_group(std::string name) { group_ = std::move(name); }
  /// A field that is already listed, so that a struct can change what a part says of it.
  Field& at(const std::string& name);
  Field& last() { return fields_.back(); }
  /// None of the fields listed so far has an option.
  void without_options(const char* why);
  /// Dashes instead of underscores in all names.
  void name_like_options();

  [[nodiscard]] int own_count() const { return own_count_; }
  [[nodiscard]] auto begin() const { return fields_.begin(); }
  [[nodiscard]] auto end() const { return fields_.end(); }

 private:
  Field& add(const std::string& name, FieldValue value, const std::string& help);
  void append(const Fields& part);

  std::deque<Field> fields_;  ///< whose elements stay where they are
  std::string group_;
  int own_count_ = 0;
};

/// The fields that `options` describes, pointing into it. Fails when the description forgets a
/// member, so the first use of a struct reveals the omission.
template <Described T>
Fields fields_of(T& options) {
  Fields fields;
  options.describe(fields);
  check(fields.own_count() == field_count<T>(), "describe() must name every member, each once");
  return fields;
}

template <Described T>
void Fields::part(T& described) {
  ++own_count_;
  append(fields_of(described));
}

/// "name = value: must be ..." for every field that breaks its constraints.
std::vector<std::string> field_problems(const Fields& fields);

template <Described T>
std::vector<std::string> field_problems(const T& options) {
  T copy = options;
  return field_problems(fields_of(copy));
}

/// Calls `visit` with every number (a double) and every text of a value.
void for_each_element(const FieldValue& value,
                      const std::function<void(double)>& number,
                      const std::function<void(const std::string&)>& text);

}  // namespace af
