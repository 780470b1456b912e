// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "field/codebook.h"
#include "field/index_coding_kernel.h"
#include "field/tile.h"

namespace af {

/// A magnitude in quarters of an octave, for comparisons: the steps are exact and the same
/// everywhere.
int quarter_octaves(float magnitude);

/// A balanced tree over all codewords except codeword 0. Each node splits its codewords into halves
/// at the median of the coefficient that varies most among them. Node 1 is the root, node n has the
/// children 2n and 2n + 1. The tree follows from the codebook alone: it is part of the file format
/// but need not be stored.
class CodewordTree {
 public:
  explicit CodewordTree(const Codebook& codebook);

  [[nodiscard]] std::size_t codeword_count() const { return coefficients_.size(); }
  [[nodiscard]] int mean_step() const { return mean_step_; }
  /// For the kernels, while this lives.
  [[nodiscard]] CodewordTables tables() const;

 private:
  /// In one line of the cache.
  struct alignas(64) Coefficients {
    TileCoefficients values;
  };
  /// Where a node that splits is stored.
  struct Place {
    std::size_t cluster;
    std::size_t within;
  };

  void split(std::uint32_t number, std::uint32_t* begin, std::uint32_t* end);
  [[nodiscard]] Place place_of(std::uint32_t number) const;

  std::vector<Coefficients> coefficients_;  ///< never empty: codeword 0; of shapes the differences
  int mean_step_ = 0;                       ///< of the codebook
  int depth_ = 0;
  std::vector<NodeCluster> clusters_;
  std::vector<std::uint16_t> codewords_at_;
  std::vector<std::uint32_t> leaves_;
};

}  // namespace af
