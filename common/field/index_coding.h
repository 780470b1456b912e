// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "field/codeword_tree.h"

namespace af {

/// Coded bytes of a block, and where its indices go.
struct CodedBlock {
  std::span<const std::uint8_t> bytes;
  std::span<std::uint16_t> indices;
};

/// Coding of a block of indices, and means, without loss, in some 40 to 55 % of the bytes that
/// deflate needs. A tile resembles its neighbours along u, s and t. So it is predicted from those
/// that come before it, and its codeword is coded as the turns left and right on its path through
/// the codebook's tree. An adaptive range coder learns how likely each turn is, given how far the
/// prediction lies from the node's threshold, relative to recent prediction errors. A mean is coded
/// first, by its difference to the prediction. Blocks do not need each other. The bytes are the
/// same on every vector width. Re-entrant. \test IndexCoding.*
class IndexCoding {
 public:
  /// So many blocks are best decoded together.
  static constexpr int kBlocksTogether = kBlocksAtOnce;

  explicit IndexCoding(const Codebook& codebook) : tree_(codebook) {}

  /// Throws std::logic_error unless there are as many indices (and means) as `tiles` says and
  /// the indices are below the number of codewords, and means are as index_problems() has them.
  [[nodiscard]] std::vector<std::uint8_t> encode(std::span<const std::uint16_t> indices,
                                                 const std::array<std::size_t, 4>& tiles) const;

  /// Some blocks of equal extents. A few are decoded alternately, turn by turn: a turn depends on
  /// the one before it in its block, but not on other blocks, so that the processor overlaps them.
  /// False when the bytes of any cannot be an encoder's for so many tiles; `indices` are then of no
  /// use, but below the number of codewords.
  [[nodiscard]] bool decode(std::span<const CodedBlock> blocks,
                            const std::array<std::size_t, 4>& tiles) const;
  [[nodiscard]] bool decode(std::span<const std::uint8_t> bytes,
                            const std::array<std::size_t, 4>& tiles,
                            std::span<std::uint16_t> indices) const;

  /// No encoder makes more of so many tiles.
  static std::size_t most_bytes(std::size_t tiles);

  /// 1, or 2 where they have means.
  [[nodiscard]] std::size_t values_per_tile() const { return tree_.mean_step() > 0 ? 2 : 1; }

 private:
  void check_values(std::span<const std::uint16_t> values,
                    const std::array<std::size_t, 4>& tiles) const;

  CodewordTree tree_;
};

}  // namespace af
