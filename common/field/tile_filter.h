// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "field/tile.h"

namespace af {

/// Where a neighbouring tile stands: -1, 0 or 1 tiles along u, v, s and t, nonzero along at most
/// two.
using TileOffset = std::array<int, 4>;

/// Inputs of a coefficient: its own; for each axis a sum and a difference of two neighbours; for
/// each pair of axes a sum, two differences and a difference of differences of four.
inline constexpr std::size_t kFilterInputs = 1 + 4 * 2 + 6 * 4;

/// Linear estimate of a tile from its decoded levels and those of its 32 neighbours across at most
/// two axes, with the least mean squared error over the field (a Wiener filter; fit_tile_filter()).
/// In a smooth field, neighbours tell what a tile's codeword has lost: how they slope and bend
/// predicts it.
///
/// It works on Hadamard coefficients, which are even or odd along each axis. Mirror symmetry leaves
/// kFilterInputs of the 528 numbers of the neighbourhood to each coefficient. Along every axis
/// where a neighbour lies, these are sums of coefficients of the same parity, or differences of
/// coefficients of the other parity. Tiles without a nonzero coefficient are empty, and stay so.
struct TileFilter {
  /// Added to coefficient j of a tile: the sum over i of weights[j][i] filter_inputs(j)[i].
  std::array<std::array<float, kFilterInputs>, kTileElements> weights{};

  bool operator==(const TileFilter&) const = default;
};

/// Larger weights would be of no use, and sums of products with them would not be finite.
inline constexpr float kLargestFilterWeight = 1e6f;

/// Why weights cannot be used; empty when they can.
std::vector<std::string> problems(const TileFilter& filter);

/// Where a neighbour stands among tiles numbered from 0 along each axis. Beyond the viewpoints, the
/// tiles at the edge stand for their neighbours. There are none beyond s and t: what is not stored
/// is 0.
inline std::optional<std::array<int, 4>> neighbouring_tile(const std::array<int, 4>& tile,
                                                           const TileOffset& offset,
                                                           const std::array<int, 4>& counts) {
  std::array<int, 4> at{};
  for (std::size_t axis = 0; axis < 4; ++axis) {
    at[axis] = tile[axis] + offset[axis];
    if (axis < 2) at[axis] = std::clamp(at[axis], 0, counts[axis] - 1);
    if (at[axis] < 0 || at[axis] >= counts[axis]) return std::nullopt;
  }
  return at;
}

/// The bit of an element's or coefficient's number that belongs to an axis (0 ... 3: u, v, s, t).
constexpr std::size_t axis_bit(std::size_t axis) {
  return std::size_t{8} >> axis;
}

/// The input that sums two neighbours along `axis`; the next one is their difference.
constexpr std::size_t axis_input(std::size_t axis) {
  return 1 + 2 * axis;
}
/// The input that sums four neighbours across axes a < b; the next ones are their differences along
/// a, along b, and along both.
constexpr std::size_t pair_input(std::size_t a, std::size_t b) {
  constexpr std::array<std::size_t, 3> kPairsBefore = {0, 3, 5};
  return axis_input(4) + 4 * (kPairsBefore[a] + b - a - 1);
}

/// Inputs of coefficient j. `coefficient(offset, k)`, a Number, is coefficient k of the tile at
/// `offset`, or, with offset 0, of the tile itself.
template <typename Number, typename Coefficient>
std::array<Number, kFilterInputs> filter_inputs(std::size_t j, Coefficient&& coefficient) {
  std::array<Number, kFilterInputs> inputs{};
  inputs[0] = coefficient(TileOffset{}, j);
  for (std::size_t axis = 0; axis < 4; ++axis)
    for (const int side : {1, -1}) {
      TileOffset offset{};
      offset[axis] = side;
      inputs[axis_input(axis)] += coefficient(offset, j);
      inputs[axis_input(axis) + 1] += side * coefficient(offset, j ^ axis_bit(axis));
    }
  for (std::size_t a = 0; a < 4; ++a)
    for (std::size_t b = a + 1; b < 4; ++b)
      for (const int side_a : {1, -1})
        for (const int side_b : {1, -1}) {
          TileOffset offset{};
          offset[a] = side_a;
          offset[b] = side_b;
          Number* of_pair = inputs.data() + pair_input(a, b);
          of_pair[0] += coefficient(offset, j);
          of_pair[1] += side_a * coefficient(offset, j ^ axis_bit(a));
          of_pair[2] += side_b * coefficient(offset, j ^ axis_bit(b));
          of_pair[3] += side_a * side_b * coefficient(offset, j ^ axis_bit(a) ^ axis_bit(b));
        }
  return inputs;
}

}  // namespace af
