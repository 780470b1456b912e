// SPDX-License-Identifier: Apache-2.0
#include "precompute/design/packed_bytes.h"

#include <vector>
#include <zlib.h>

#include "base/error.h"

namespace af {
namespace {

std::size_t deflated_bytes(const std::vector<std::uint16_t>& values) {
  constexpr int kLevel = 6;
  std::vector<Bytef> shuffled(2 * values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    shuffled[i] = static_cast<Bytef>(values[i] & 0xFFu);
    shuffled[values.size() + i] = static_cast<Bytef>(values[i] >> 8u);
  }
  uLongf bytes = compressBound(shuffled.size());
  std::vector<Bytef> packed(bytes);
  check(compress2(packed.data(), &bytes, shuffled.data(), shuffled.size(), kLevel) == Z_OK,
        "zlib compresses what fits");
  return bytes;
}

}  // namespace

std::size_t packed_bytes(std::span<const std::uint16_t> values,
                         std::size_t row_tiles,
                         bool has_means) {
  if (!has_means) return deflated_bytes({values.begin(), values.end()});
  const std::size_t rows = values.size() / (2 * row_tiles);
  std::vector<std::uint16_t> codewords;
  std::vector<std::uint16_t> means(rows * row_tiles);
  for (std::size_t row = 0; row < rows; ++row) {
    const auto of_row = values.subspan(2 * row * row_tiles, 2 * row_tiles);
    codewords.insert(
        codewords.end(), of_row.begin(), of_row.begin() + static_cast<std::ptrdiff_t>(row_tiles));
    for (std::size_t t = 0; t < row_tiles; ++t) {
      const int before = t == 0 ? 0 : of_row[row_tiles + t - 1];
      means[t * rows + row] = static_cast<std::uint16_t>(of_row[row_tiles + t] - before);
    }
  }
  return deflated_bytes(codewords) + deflated_bytes(means);
}

}  // namespace af
