// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "field/codeword_tree.h"

namespace af {

/// Coding of a block of indices [u][v][s][t] without loss, in some 40 to 55 % of the bytes that
/// deflate needs. A tile resembles its neighbours along u, s and t. So it is predicted from those
/// that come before it, and its codeword is told by the turns of the way to it through the
/// codebook's tree. An adaptive range coder learns how likely each turn is, given how far the
/// prediction lies from the node's threshold, measured by what predictions were wrong by of late.
/// Blocks do not need each other. The bytes are the same on every vector width. Re-entrant.
/// \test IndexCoding
class IndexCoding {
 public:
  explicit IndexCoding(const Codebook& codebook) : tree_(codebook) {}

  /// Throws std::logic_error unless there are as many indices as `tiles` says and all are below the
  /// number of codewords.
  [[nodiscard]] std::vector<std::uint8_t> encode(std::span<const std::uint16_t> indices,
                                                 const std::array<std::size_t, 4>& tiles) const;

  /// False when the bytes cannot be an encoder's for so many tiles; `indices` are then of no use,
  /// but below the number of codewords.
  [[nodiscard]] bool decode(std::span<const std::uint8_t> bytes,
                            const std::array<std::size_t, 4>& tiles,
                            std::span<std::uint16_t> indices) const;

 private:
  CodewordTree tree_;
};

}  // namespace af
