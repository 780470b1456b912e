// SPDX-License-Identifier: Apache-2.0
// Every option struct of every program (checks.options sees to it): its description covers it, and
// outputs record it.
#include <set>
#include <string>
#include <toml++/toml.h>

#include <gtest/gtest.h>

#include "evaluate/image_quality/evaluate_image_quality.h"
#include "evaluate/image_quality/measure_held_out.h"
#include "evaluate/registration/compare_methods.h"
#include "evaluate/registration/evaluate_registrations.h"
#include "evaluate/registration/join_studies.h"
#include "evaluate/registration/measure_population.h"
#include "evaluate/report/make_report.h"
#include "evaluate/scan/scan_options.h"
#include "evaluate/simulate/simulate_options.h"
#include "evaluate/sweeps/draw_similarity_curves.h"
#include "evaluate/sweeps/make_error_budget.h"
#include "evaluate/sweeps/measure_lattice_errors.h"
#include "evaluate/sweeps/sweep_field_parameters.h"
#include "files/options_toml.h"
#include "precompute/build/precompute_options.h"
#include "ranks/stop_request.h"
#include "register/register_options.h"
#include "tools/drr/drr_request.h"
#include "tools/inspect/inspect_run.h"

namespace af {
namespace {

/// Gives every field a value: other than the default, and harder to write than most.
struct Filler {
  void operator()(bool* value) const { *value = !*value; }
  void operator()(int* value) const { *value += 7; }
  void operator()(std::int64_t* value) const { *value += 7; }
  void operator()(std::uint64_t* value) const { *value += 7; }
  void operator()(double* value) const { *value = *value / 3.0 + 1e-7; }
  void operator()(std::string* value) const { *value += "\"x\\\ty\n"; }
  void operator()(std::filesystem::path* value) const { *value = "a b/\"c\".toml"; }
  template <typename T, std::size_t Size>
  void operator()(std::array<T, Size>* values) const {
    for (T& value : *values) (*this)(&value);
  }
  template <typename T>
  void operator()(std::vector<T>* values) const {
    values->resize(3);
    for (T& value : *values) (*this)(&value);
  }
  template <typename T>
  void operator()(std::optional<T>* value) const {
    value->emplace();
    (*this)(&**value);
  }
};

/// Whether a node of TOML holds a value, to the bit.
struct Holds {
  const toml::node& node;

  template <typename T>
  bool operator()(const T* value) const {
    return is(node, *value);
  }
  static bool is(const toml::node& node, bool value) { return node.value_exact<bool>() == value; }
  static bool is(const toml::node& node, double value) {
    return node.value_exact<double>() == value;
  }
  template <std::integral T>
  static bool is(const toml::node& node, T value) {
    return node.value_exact<std::int64_t>() == static_cast<std::int64_t>(value);
  }
  static bool is(const toml::node& node, const std::string& value) {
    return node.value_exact<std::string>() == value;
  }
  static bool is(const toml::node& node, const std::filesystem::path& value) {
    return is(node, value.string());
  }
  template <typename T>
  static bool is(const toml::node& node, const std::optional<T>& value) {
    return value.has_value() && is(node, *value);
  }
  template <typename T, std::size_t Size>
  static bool is(const toml::node& node, const std::array<T, Size>& values) {
    return is_list(node, values);
  }
  template <typename T>
  static bool is(const toml::node& node, const std::vector<T>& values) {
    return is_list(node, values);
  }
  template <typename List>
  static bool is_list(const toml::node& node, const List& values) {
    const toml::array* array = node.as_array();
    if (array == nullptr || array->size() != values.size()) return false;
    for (std::size_t i = 0; i < values.size(); ++i)
      if (!is(*array->get(i), values[i])) return false;
    return true;
  }
};

void expect_recorded(const Fields& fields, bool expects_all) {
  const std::string text = toml_of_fields(fields);
  const toml::table table = toml::parse(text);
  std::size_t recorded = 0;
  for (const Field& field : fields) {
    const toml::node* node = table.get(field.name);
    if (!field.is_recorded) continue;
    if (node == nullptr) {
      EXPECT_FALSE(expects_all) << field.name << " is not in\n" << text;
      recorded += table.contains(field.name_when_unset) ? 1U : 0U;
      continue;
    }
    ++recorded;
    EXPECT_TRUE(std::visit(Holds{*node}, field.value)) << field.name << " in\n" << text;
  }
  EXPECT_EQ(recorded, table.size()) << text;
}

template <typename T>
class DescribedOptions : public testing::Test {};

using AllOptions = testing::Types<PrecomputeOptions,
                                  RunLimits,
                                  registration::MethodOptions,
                                  registration::RegisterOptions,
                                  evaluation::ImageQualityOptions,
                                  evaluation::HeldOutOptions,
                                  evaluation::RegistrationStudyOptions,
                                  evaluation::SimilarityCurvesOptions,
                                  evaluation::FieldParametersOptions,
                                  evaluation::CompareOptions,
                                  evaluation::ErrorBudgetOptions,
                                  evaluation::LatticeErrorsOptions,
                                  evaluation::JoinStudiesOptions,
                                  evaluation::PopulationOptions,
                                  evaluation::ReportOptions,
                                  tools::DrrOptions,
                                  InspectOptions,
                                  tools::ScanOptions,
                                  tools::SimulateOptions>;
TYPED_TEST_SUITE(DescribedOptions, AllOptions);

TYPED_TEST(DescribedOptions, NameEveryMemberOnce) {
  TypeParam options;
  std::set<std::string> recorded;
  std::set<std::string> typed;
  for (const Field& field : fields_of(options)) {
    if (field.is_recorded) {
      EXPECT_TRUE(recorded.insert(field.name).second) << field.name;
    }
    if (!field.option.empty()) {
      EXPECT_TRUE(typed.insert(field.option).second) << field.option;
    }
    EXPECT_FALSE(field.help.empty()) << field.name;
  }
}

TYPED_TEST(DescribedOptions, RecordTheirDefaultsToTheBit) {
  TypeParam options;
  expect_recorded(fields_of(options), false);
}

TYPED_TEST(DescribedOptions, RecordWhateverIsGiven) {
  TypeParam options;
  for (const Field& field : fields_of(options)) std::visit(Filler{}, field.value);
  expect_recorded(fields_of(options), true);
}

}  // namespace
}  // namespace af
