// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace af {

/// Elements of a tile: 2 x 2 x 2 x 2 neighbours in (u, v, s, t), Sec. II-D.
inline constexpr std::size_t kTileElements = 16;

/// Position of an element within its tile; offsets are 0 or 1, t is fastest.
constexpr std::size_t tile_element(unsigned du, unsigned dv, unsigned ds, unsigned dt) {
  return ((du * 2u + dv) * 2u + ds) * 2u + dt;
}

/// Quantised total attenuation of 16 neighbouring rays.
using Tile = std::array<std::uint16_t, kTileElements>;

inline bool is_zero(const Tile& tile) {
  std::uint16_t any = 0;
  for (const std::uint16_t level : tile) any = static_cast<std::uint16_t>(any | level);
  return any == 0;
}

/// An exact tile in the coordinates of the 4-D Hadamard transform. Coefficient j is the sum of the
/// levels, each negated if its element number shares an odd number of bits with j.
using TileCoefficients = std::array<float, kTileElements>;

TileCoefficients hadamard_coefficients(const Tile& tile);

}  // namespace af
