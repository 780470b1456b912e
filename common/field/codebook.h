// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "field/tile.h"

namespace af {

inline constexpr std::size_t kMaxCodewords = 65536;  ///< an index is 16 bits

/// Codewords of the vector quantiser, sorted by the sum of their elements (ties:
/// lexicographically), so that codeword 0 is the zero tile and a search can bound distances by the
/// sum alone.
struct Codebook {
  std::vector<Tile> codewords;

  [[nodiscard]] std::size_t size() const { return codewords.size(); }
};

/// Sum of a tile's elements: its DC coefficient before scaling.
std::uint32_t tile_sum(const Tile& tile);

/// The order in which a codebook is kept.
bool codeword_less(const Tile& a, const Tile& b);

/// Why a codebook is not usable: size not in 1 ... 65536, codeword 0 not zero, order broken; empty
/// when it is.
std::vector<std::string> problems(const Codebook& codebook);

}  // namespace af
