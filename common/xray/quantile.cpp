// SPDX-License-Identifier: Apache-2.0
#include "xray/quantile.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "base/error.h"

namespace af {
namespace {

float nth(std::vector<float> values, std::size_t n) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(n);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// Two of the values. The nth value almost certainly lies between them.
std::pair<float, float> bracket(std::span<const float> values, std::size_t n) {
  constexpr std::size_t kSamples = 1024;
  std::array<float, kSamples> sample{};
  // This stride spreads samples widely, and not in step with the rows of a picture.
  constexpr std::uint64_t kStride = 0x9E3779B1;
  for (std::size_t i = 0; i < kSamples; ++i) sample[i] = values[i * kStride % values.size()];
  std::sort(sample.begin(), sample.end());
  const double share = static_cast<double>(n) / static_cast<double>(values.size());
  constexpr double kCount = kSamples;
  const double middle = share * kCount;
  const double margin = 4.0 * std::sqrt(share * (1.0 - share) * kCount) + 4.0;
  const auto at = [&](double rank) {
    return sample[static_cast<std::size_t>(std::clamp(rank, 0.0, kCount - 1.0))];
  };
  return {at(middle - margin), at(middle + margin)};
}

}  // namespace

float nearest_rank(std::span<const float> values, double share) {
  check(!values.empty(), "a quantile is that of some values");
  const std::size_t n = static_cast<std::size_t>(
                            std::max(1.0, std::ceil(share * static_cast<double>(values.size())))) -
                        1;
  // Partitioning a whole picture takes ten times as long as one pass that picks out a few percent.
  const auto [low, high] = bracket(values, n);
  std::size_t below = 0;
  std::vector<float> between;
  for (const float value : values) {
    below += value < low ? 1 : 0;
    if (value >= low && value <= high) between.push_back(value);
  }
  if (n >= below && n - below < between.size()) return nth(std::move(between), n - below);
  return nth({values.begin(), values.end()}, n);
}

}  // namespace af
