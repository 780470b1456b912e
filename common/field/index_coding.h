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

/// Lossless coding of blocks of indices, and means, in some 40 to 55 % of the bytes that deflate
/// needs. A tile resembles its neighbours along u, s and t, so it is predicted from those that come
/// before it, and its codeword is coded as the left and right turns on its path through the
/// codebook's tree. An adaptive range coder learns how likely each turn is, given how far the
/// prediction lies from the node's threshold, relative to recent prediction errors. A mean is coded
/// first, as its difference from the prediction. Blocks are independent of each other. The bytes
/// are the same on every vector width. Re-entrant. \test IndexCoding.*
class IndexCoding {
 public:
  /// The number of blocks that are best decoded together.
  static constexpr int kBlocksTogether = kBlocksAtOnce;

  explicit IndexCoding(const Codebook& codebook) : tree_(codebook) {}

  /// Throws std::logic_error unless there are as many indices (and means) as `tiles` says and
  /// the indices are below the number of codewords, and means are as index_problems() has them.
  [[nodiscard]] std::vector<std::uint8_t> encode(std::span<const std::uint16_t> indices,
                                                 const std::array<std::size_t, 4>& tiles) const;

  /// Decodes blocks of equal extents. A few are decoded alternately, turn by turn: a turn depends
  /// on the one before it in its block but not on other blocks, so the processor overlaps them.
  /// Returns false when the bytes of any block cannot be an encoder's for so many tiles; `indices`
  /// are then meaningless, but below the number of codewords.
  [[nodiscard]] bool decode(std::span<const CodedBlock> blocks,
                            const std::array<std::size_t, 4>& tiles) const;
  [[nodiscard]] bool decode(std::span<const std::uint8_t> bytes,
                            const std::array<std::size_t, 4>& tiles,
                            std::span<std::uint16_t> indices) const;

  /// The most bytes that an encoder makes of so many tiles.
  static std::size_t most_bytes(std::size_t tiles);

  /// 1, or 2 where they have means.
  [[nodiscard]] std::size_t values_per_tile() const { return tree_.mean_step() > 0 ? 2 : 1; }

 private:
  void check_values(std::span<const std::uint16_t> values,
                    const std::array<std::size_t, 4>& tiles) const;

  CodewordTree tree_;
};

}  // namespace af
