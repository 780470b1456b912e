// SPDX-License-Identifier: Apache-2.0
#include "field/codeword_tree.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <span>
#include <utility>

namespace af {

namespace {

/// Of one coefficient over some codewords. Sums of integers below 2^21 and of their squares: exact,
/// whatever the order.
template <typename ValueOf>
double variance_of(const ValueOf& value_of, const std::uint32_t* begin, const std::uint32_t* end) {
  std::int64_t sum = 0;
  std::int64_t squares = 0;
  for (const std::uint32_t* codeword = begin; codeword != end; ++codeword) {
    const auto value = static_cast<std::int64_t>(value_of(*codeword));
    sum += value;
    squares += value * value;
  }
  const auto count = static_cast<double>(end - begin);
  const double mean = static_cast<double>(sum) / count;
  return static_cast<double>(squares) / count - mean * mean;
}

}  // namespace

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
    coefficients_.push_back({hadamard_coefficients(codeword)});
  if (codebook.has_means()) {
    mean_step_ = codebook.mean_step;
    for (auto& of_shape : std::span(coefficients_).subspan(1))
      of_shape.values[0] -= static_cast<float>(kTileElements) * kShapeZero;
  }
  leaves_.assign(codebook.size(), 0);
  if (codebook.size() < 2) return;
  std::vector<std::uint32_t> codewords(codebook.size() - 1);
  std::iota(codewords.begin(), codewords.end(), 1u);
  depth_ = static_cast<int>(std::bit_width(codewords.size() - 1));
  codewords_at_.assign(std::size_t{2} << depth_, 0);
  std::size_t clusters = 0;
  for (int levels = depth_; levels > 0; levels -= kLevelsOfCluster)
    clusters = kNodesOfCluster * clusters + 1;
  clusters_.resize(clusters);
  split(1, codewords.data(), codewords.data() + codewords.size());
}

CodewordTables CodewordTree::tables() const {
  return {clusters_.data(),
          static_cast<std::uint32_t>(place_of(1).within),
          codewords_at_.data(),
          depth_,
          coefficients_.front().values.data(),
          leaves_.data(),
          static_cast<std::uint32_t>(coefficients_.size()),
          mean_step_};
}

CodewordTree::Place CodewordTree::place_of(std::uint32_t number) const {
  // Levels that there are not, above the root, fill the uppermost cluster.
  const int missing = (kLevelsOfCluster - depth_ % kLevelsOfCluster) % kLevelsOfCluster;
  Place place{0, std::size_t{1} << static_cast<unsigned>(missing)};
  for (int left = static_cast<int>(std::bit_width(number)) - 2; left >= 0; --left) {
    const std::size_t turn = number >> static_cast<unsigned>(left) & 1u;
    place.within = 2 * place.within + turn;
    if (place.within >= kNodesOfCluster)
      place = {kNodesOfCluster * place.cluster + 1 + place.within - kNodesOfCluster, 1};
  }
  return place;
}

void CodewordTree::split(std::uint32_t number, std::uint32_t* begin, std::uint32_t* end) {
  if (end - begin == 1) {
    codewords_at_[number] = static_cast<std::uint16_t>(*begin);
    leaves_[*begin] = number;
    return;
  }
  const auto value_of = [&](std::size_t j) {
    return [this, j](std::uint32_t codeword) { return coefficients_[codeword].values[j]; };
  };
  double widest = -1.0;
  std::size_t coefficient = 0;
  for (std::size_t j = 0; j < kTileElements; ++j)
    if (const double variance = variance_of(value_of(j), begin, end); variance > widest) {
      widest = variance;
      coefficient = j;
    }
  const auto value = value_of(coefficient);
  const auto less = [&](std::uint32_t a, std::uint32_t b) {
    return std::pair(value(a), a) < std::pair(value(b), b);
  };
  std::uint32_t* const middle = begin + (end - begin) / 2;
  std::nth_element(begin, middle, end, less);
  const float low = value(*std::max_element(begin, middle, less));
  const int octaves = quarter_octaves(static_cast<float>(std::sqrt(std::max(widest, 0.0))));
  const Place place = place_of(number);
  clusters_[place.cluster].thresholds[place.within] = (low + value(*middle)) / 2.0f;
  clusters_[place.cluster].splits[place.within] =
      kNodesOfCluster * octaves + static_cast<std::int32_t>(coefficient);
  split(2 * number, begin, middle);
  split(2 * number + 1, middle, end);
}

}  // namespace af
