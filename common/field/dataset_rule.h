// SPDX-License-Identifier: Apache-2.0
// What the datasets of a field file look like. Internal to field_file, and free of HDF5.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <tuple>
#include <vector>

namespace af::field_layout {

enum class ElementType { Float64, Float32, Int32, UInt16, Text };

std::size_t element_bytes(ElementType type);
const char* to_string(ElementType type);

/// What a dataset must look like. A text's only extent is its length in bytes.
struct DatasetRule {
  std::string name;  ///< path within the file
  ElementType type = ElementType::Float64;
  std::vector<std::uint64_t>
      extents;  ///< for a text and the codebook, the first is the largest allowed
  bool is_first_extent_free = false;  ///< the first extent may be 1 ... extents[0]
  std::string units;
  std::string frame;
  std::uint64_t rows_per_tile = 1;  ///< for indices: 2 where rows of means follow theirs along s

  [[nodiscard]] std::uint64_t value_count() const;
};

/// A small dataset, held whole.
struct Dataset {
  DatasetRule rule;  ///< with its true extents
  std::vector<std::byte> bytes;

  /// What other ranks need to know of it.
  auto members() { return std::tie(rule.name, rule.type, rule.extents, bytes); }
};

}  // namespace af::field_layout
