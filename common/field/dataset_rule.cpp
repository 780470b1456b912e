// SPDX-License-Identifier: Apache-2.0
#include "field/dataset_rule.h"

#include <functional>
#include <numeric>

namespace af::field_layout {

std::uint64_t DatasetRule::value_count() const {
  return std::accumulate(extents.begin(), extents.end(), std::uint64_t{1}, std::multiplies<>());
}

std::size_t element_bytes(ElementType type) {
  switch (type) {
    case ElementType::Float64:
      return 8;
    case ElementType::Float32:
    case ElementType::Int32:
      return 4;
    case ElementType::UInt16:
      return 2;
    case ElementType::Text:
      break;
  }
  return 1;
}

const char* to_string(ElementType type) {
  switch (type) {
    case ElementType::Float64:
      return "float64";
    case ElementType::Float32:
      return "float32";
    case ElementType::Int32:
      return "int32";
    case ElementType::UInt16:
      return "uint16";
    case ElementType::Text:
      break;
  }
  return "text";
}

}  // namespace af::field_layout
