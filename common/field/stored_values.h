// SPDX-License-Identifier: Apache-2.0
// How numbers and texts of structs become datasets, and back. Internal to field_file, and free of
// HDF5.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "base/error.h"
#include "field/dataset_rule.h"

namespace af::field_layout {

template <typename T>
Dataset dataset_of(const DatasetRule& rule, std::span<const T> values) {
  Dataset dataset{rule, {}};
  const auto bytes = std::as_bytes(values);
  dataset.bytes.assign(bytes.begin(), bytes.end());
  if (rule.is_first_extent_free) {
    std::uint64_t inner = 1;
    for (std::size_t i = 1; i < rule.extents.size(); ++i) inner *= rule.extents[i];
    dataset.rule.extents[0] = values.size() / inner;
  }
  return dataset;
}

Dataset text_dataset(const DatasetRule& rule, const std::string& text);

/// Throws FileError on NaN.
template <typename T>
std::vector<T> values_of(const Dataset& dataset, const std::string& path) {
  check(dataset.bytes.size() % sizeof(T) == 0, "bytes of whole elements");
  std::vector<T> values(dataset.bytes.size() / sizeof(T));
  if (!values.empty()) std::memcpy(values.data(), dataset.bytes.data(), dataset.bytes.size());
  if constexpr (std::is_floating_point_v<T>)
    for (const T value : values)
      if (std::isnan(value)) throw FileError(path, dataset.rule.name, "numbers", "NaN");
  return values;
}

std::string text_of(const Dataset& dataset);

/// A dataset and where its numbers, or its text, are in memory.
struct StoredValue {
  DatasetRule rule;
  std::variant<std::vector<double*>, std::vector<std::int32_t*>, std::string*> places;
  bool may_be_infinite = false;
};

/// The stored values of a struct, each listed once, in the fixed order of the payload hash. Rules,
/// datasets to write and values read follow from the list.
class StoredValues {
 public:
  explicit StoredValues(std::string group) : group_(std::move(group)) {}

  template <typename T>
  StoredValue& numbers(const char* name,
                       std::initializer_list<T*> places,
                       const char* units,
                       const char* frame) {
    return add(name, std::vector(places), {places.size()}, units, frame);
  }
  /// Row by row.
  template <typename Derived>
  void matrix(const char* name,
              Eigen::PlainObjectBase<Derived>& matrix,
              const char* units,
              const char* frame) {
    std::vector<typename Derived::Scalar*> places;
    for (Eigen::Index row = 0; row < matrix.rows(); ++row)
      for (Eigen::Index column = 0; column < matrix.cols(); ++column)
        places.push_back(&matrix(row, column));
    std::vector<std::uint64_t> extents = {static_cast<std::uint64_t>(matrix.rows())};
    if (matrix.cols() > 1) extents.push_back(static_cast<std::uint64_t>(matrix.cols()));
    add(name, places, extents, units, frame);
  }
  void text(const char* name, std::string& text, std::uint64_t most_bytes) {
    values_.push_back({{group_ + name, ElementType::Text, {most_bytes}, true, "1", "none"}, &text});
  }
  void start_group(std::string group) { group_ = std::move(group); }

  [[nodiscard]] const std::vector<StoredValue>& list() const { return values_; }

 private:
  template <typename T>
  StoredValue& add(const char* name,
                   const std::vector<T*>& places,
                   const std::vector<std::uint64_t>& extents,
                   const char* units,
                   const char* frame) {
    constexpr ElementType kType =
        std::is_same_v<T, double> ? ElementType::Float64 : ElementType::Int32;
    values_.push_back({{group_ + name, kType, extents, false, units, frame}, places});
    return values_.back();
  }

  std::string group_;
  std::vector<StoredValue> values_;
};

void append_rules(const StoredValues& values, std::vector<DatasetRule>& rules);
void append_datasets(const StoredValues& values, std::vector<Dataset>& datasets);

/// Takes values from the first datasets and returns the others. Throws FileError on NaN, and on
/// infinity where a value must be finite.
std::span<const Dataset> set_values(const StoredValues& values,
                                    std::span<const Dataset> datasets,
                                    const std::string& path);

}  // namespace af::field_layout
