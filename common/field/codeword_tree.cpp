// SPDX-License-Identifier: Apache-2.0
#include "field/codeword_tree.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <utility>

namespace af {

namespace {

/// Of one coefficient over some codewords. Sums of integers below 2^21 and of their squares: exact,
/// whatever the order.
double variance_of(const std::vector<TileCoefficients>& coefficients,
                   std::size_t coefficient,
                   const std::uint32_t* begin,
                   const std::uint32_t* end) {
  std::int64_t sum = 0;
  std::int64_t squares = 0;
  for (const std::uint32_t* codeword = begin; codeword != end; ++codeword) {
    const auto value = static_cast<std::int64_t>(coefficients[*codeword][coefficient]);
    sum += value;
    squares += value * value;
  }
  const auto count = static_cast<double>(end - begin);
  const double mean = static_cast<double>(sum) / count;
  return static_cast<double>(squares) / count - mean * mean;
}

}  // namespace

TileCoefficients hadamard_coefficients(const Tile& tile) {
  TileCoefficients values{};
  std::copy(tile.begin(), tile.end(), values.begin());
  for (std::size_t stride = 1; stride < kTileElements; stride *= 2)
    for (std::size_t i = 0; i < kTileElements; ++i)
      if ((i & stride) == 0) {
        const float a = values[i];
        const float b = values[i | stride];
        values[i] = a + b;
        values[i | stride] = a - b;
      }
  return values;
}

int quarter_octaves(float magnitude) {
  constexpr unsigned kMantissaBits = 23;
  constexpr unsigned kKept = 2;
  constexpr int kOfOne = 127 << kKept;
  return static_cast<int>(std::bit_cast<std::uint32_t>(magnitude + 1.0f) >>
                          (kMantissaBits - kKept)) -
         kOfOne;
}

CodewordTree::CodewordTree(const Codebook& codebook) {
  coefficients_.reserve(codebook.size());
  for (const Tile& codeword : codebook.codewords)
    coefficients_.push_back(hadamard_coefficients(codeword));
  leaves_.assign(codebook.size(), 0);
  if (codebook.size() < 2) return;
  std::vector<std::uint32_t> codewords(codebook.size() - 1);
  std::iota(codewords.begin(), codewords.end(), 1u);
  nodes_.resize(2 * std::bit_ceil(codewords.size()));
  split(1, codewords.data(), codewords.data() + codewords.size());
}

void CodewordTree::split(std::uint32_t number, std::uint32_t* begin, std::uint32_t* end) {
  Node& node = nodes_[number];
  if (end - begin == 1) {
    node.codeword = static_cast<std::uint16_t>(*begin);
    leaves_[*begin] = number;
    return;
  }
  double widest = -1.0;
  for (std::size_t j = 0; j < kTileElements; ++j)
    if (const double variance = variance_of(coefficients_, j, begin, end); variance > widest) {
      widest = variance;
      node.coefficient = static_cast<std::uint8_t>(j);
    }
  const std::size_t j = node.coefficient;
  const auto less = [&](std::uint32_t a, std::uint32_t b) {
    return std::pair(coefficients_[a][j], a) < std::pair(coefficients_[b][j], b);
  };
  std::uint32_t* const middle = begin + (end - begin) / 2;
  std::nth_element(begin, middle, end, less);
  const float low = coefficients_[*std::max_element(begin, middle, less)][j];
  node.threshold = (low + coefficients_[*middle][j]) / 2.0f;
  node.quarter_octaves = static_cast<std::int8_t>(
      quarter_octaves(static_cast<float>(std::sqrt(std::max(widest, 0.0)))));
  split(2 * number, begin, middle);
  split(2 * number + 1, middle, end);
}

}  // namespace af
