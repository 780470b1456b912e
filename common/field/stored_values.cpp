// SPDX-License-Identifier: Apache-2.0
#include "field/stored_values.h"

#include <cmath>

namespace af::field_layout {

namespace {

template <typename T>
void set_numbers(const Dataset& dataset,
                 const StoredValue& value,
                 const std::vector<T*>& places,
                 const std::string& path) {
  const std::vector<T> numbers = values_of<T>(dataset, path);
  check(numbers.size() == places.size(), "extents of the rule");
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (!value.may_be_infinite && std::isinf(static_cast<double>(numbers[i])))
      throw FileError(path, value.rule.name, "finite numbers", "infinity");
    *places[i] = numbers[i];
  }
}

}  // namespace

Dataset text_dataset(const DatasetRule& rule, const std::string& text) {
  // HDF5 has no string type of length 0.
  return dataset_of<char>(rule, text.empty() ? std::string(1, '\0') : text);
}

std::string text_of(const Dataset& dataset) {
  std::string text(reinterpret_cast<const char*>(dataset.bytes.data()), dataset.bytes.size());
  while (!text.empty() && text.back() == '\0') text.pop_back();
  return text;
}

void append_rules(const StoredValues& values, std::vector<DatasetRule>& rules) {
  for (const StoredValue& value : values.list()) rules.push_back(value.rule);
}

void append_datasets(const StoredValues& values, std::vector<Dataset>& datasets) {
  for (const StoredValue& value : values.list())
    datasets.push_back(std::visit(
        [&]<typename Places>(const Places& places) {
          if constexpr (std::is_same_v<Places, std::string*>) {
            return text_dataset(value.rule, *places);
          } else {
            std::vector<std::remove_pointer_t<typename Places::value_type>> numbers;
            numbers.reserve(places.size());
            for (const auto* place : places) numbers.push_back(*place);
            return dataset_of<typename decltype(numbers)::value_type>(value.rule, numbers);
          }
        },
        value.places));
}

std::span<const Dataset> set_values(const StoredValues& values,
                                    std::span<const Dataset> datasets,
                                    const std::string& path) {
  const std::vector<StoredValue>& list = values.list();
  check(datasets.size() >= list.size(), "a dataset per rule");
  for (std::size_t i = 0; i < list.size(); ++i) {
    const Dataset& dataset = datasets[i];
    const StoredValue& value = list[i];
    if (std::string* const* text = std::get_if<std::string*>(&value.places))
      **text = text_of(dataset);
    else if (const auto* doubles = std::get_if<std::vector<double*>>(&value.places))
      set_numbers(dataset, value, *doubles, path);
    else
      set_numbers(dataset, value, std::get<std::vector<std::int32_t*>>(value.places), path);
  }
  return datasets.subspan(list.size());
}

}  // namespace af::field_layout
