// SPDX-License-Identifier: Apache-2.0
#include "field/index_coding.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <stdexcept>

#include "base/error.h"
#include "base/vector_width.h"
#include "field/range_coder.h"
#include "field/tile_prediction_kernel.h"

namespace af {

namespace {

/// Everything here is part of the format of files: other numbers are another coding.
constexpr std::size_t kSurpriseClasses = 24;
constexpr std::size_t kDistances = 32;  ///< of a prediction from a threshold, with their sign
constexpr std::size_t kWidths = 16;     ///< of a node against the usual error
constexpr std::size_t kOrders = 3;      ///< mean, slopes, the rest
constexpr std::size_t kEmptyContexts = 3 * 3 * 3 * 3 * 3;
constexpr float kFirstSurprise = 64.0f;
constexpr float kForgetting = 1.0f / 32.0f;
/// Least probabilities, of 65536. That of empty tiles bounds how far a block can shrink: to a
/// 704th.
constexpr std::uint32_t kLeastTurn = 32;
constexpr std::uint32_t kLeastEmpty = 1024;

/// How many axes a coefficient is a difference along: 0, 1, more.
constexpr std::size_t order_of(std::size_t coefficient) {
  return std::min<std::size_t>(2, static_cast<std::size_t>(std::popcount(coefficient)));
}

/// Where the neighbours lie that a tile is predicted from: steps along u, s and t. All come before
/// it in the order of tiles.
struct Step {
  int u;
  int s;
  int t;
};
constexpr std::array<Step, kPredictors> kPredictionSteps = {{{-1, 0, 0},
                                                             {0, -1, 0},
                                                             {0, 0, -1},
                                                             {0, -1, -1},
                                                             {-1, 1, 0},
                                                             {-1, 0, 1},
                                                             {-1, -1, 0},
                                                             {-1, 0, -1}}};
/// Neighbours whose surprise tells what to expect: the first four.
constexpr std::size_t kSurprising = 4;
/// Neighbours that tell whether a tile is empty.
constexpr std::array<std::size_t, 5> kTellEmpty = {0, 1, 2, 4, 5};

/// What is known of a neighbour.
struct Neighbour {
  enum class State : std::size_t { Missing, Empty, Occupied };
  State state = State::Missing;
  std::uint16_t codeword = 0;
  float surprise = 0.0f;
};
using Neighbours = std::array<Neighbour, kPredictors>;

/// By what predictions of each coefficient were wrong by of late, where neighbours were surprising
/// to this degree.
class UsualErrors {
 public:
  UsualErrors() {
    for (std::size_t c = 0; c < kSurpriseClasses; ++c) {
      errors_[c].fill(std::ldexp(0.6f, static_cast<int>(c)));
      for (std::size_t j = 0; j < kTileElements; ++j)
        octaves_[c][j] = quarter_octaves(errors_[c][j]);
    }
  }

  /// In quarters of an octave.
  [[nodiscard]] const std::array<int, kTileElements>& octaves(std::size_t surprise_class) const {
    return octaves_[surprise_class];
  }
  void learn(std::size_t surprise_class, const TileCoefficients& errors) {
    TileCoefficients& usual = errors_[surprise_class];
    for (std::size_t j = 0; j < kTileElements; ++j) {
      usual[j] += (errors[j] - usual[j]) * kForgetting;
      octaves_[surprise_class][j] = quarter_octaves(usual[j]);
    }
  }

 private:
  std::array<TileCoefficients, kSurpriseClasses> errors_;
  std::array<std::array<int, kTileElements>, kSurpriseClasses> octaves_;
};

/// Codes the tiles of one block, with a RangeEncoder those that are given, with a RangeDecoder
/// those that it finds.
template <typename Coder>
class BlockCoder {
 public:
  BlockCoder(const CodewordTree& tree, const std::array<std::size_t, 4>& tiles, Coder& coder)
      : tree_(tree),
        tiles_(tiles),
        coder_(coder),
        predict_(select_kernel<PredictFunction>(
            kernels_128::predict_tile, kernels_256::predict_tile, kernels_512::predict_tile)),
        surprises_(tiles[0] * tiles[1] * tiles[2] * tiles[3]),
        turns_(kDistances * kWidths * kOrders),
        empties_(kEmptyContexts) {
    for (std::size_t i = 0; i < kPredictors; ++i) {
      const Step& step = kPredictionSteps[i];
      offsets_[i] =
          (step.u * signed_of(tiles[1]) * signed_of(tiles[2]) + step.s) * signed_of(tiles[3]) +
          step.t;
    }
  }

  /// What is read from `indices` is what came before, and with an encoder the tile itself.
  void code(std::span<std::uint16_t> indices) {
    std::size_t tile = 0;
    for (std::size_t u = 0; u < tiles_[0]; ++u)
      for (std::size_t v = 0; v < tiles_[1]; ++v)
        for (std::size_t s = 0; s < tiles_[2]; ++s)
          for (std::size_t t = 0; t < tiles_[3]; ++t, ++tile) {
            std::array<bool, kPredictors> is_there{};
            for (std::size_t i = 0; i < kPredictors; ++i)
              is_there[i] = has(u, kPredictionSteps[i].u, tiles_[0]) &&
                            has(s, kPredictionSteps[i].s, tiles_[2]) &&
                            has(t, kPredictionSteps[i].t, tiles_[3]);
            indices[tile] = code_tile(neighbours(indices, tile, is_there), tile, indices[tile]);
          }
  }

 private:
  static std::ptrdiff_t signed_of(std::size_t value) { return static_cast<std::ptrdiff_t>(value); }
  static bool has(std::size_t at, int step, std::size_t count) {
    return step == 0 || (step < 0 ? at > 0 : at + 1 < count);
  }

  Neighbours neighbours(std::span<const std::uint16_t> indices,
                        std::size_t tile,
                        const std::array<bool, kPredictors>& is_there) const {
    Neighbours found;
    for (std::size_t i = 0; i < kPredictors; ++i) {
      if (!is_there[i]) continue;
      const auto at = static_cast<std::size_t>(signed_of(tile) + offsets_[i]);
      found[i].codeword = indices[at];
      found[i].surprise = surprises_[at];
      found[i].state = indices[at] == 0 ? Neighbour::State::Empty : Neighbour::State::Occupied;
    }
    return found;
  }

  std::uint16_t code_tile(const Neighbours& around, std::size_t tile, std::uint16_t wanted) {
    std::size_t context = 0;
    for (const std::size_t i : kTellEmpty)
      context = 3 * context + static_cast<std::size_t>(around[i].state);
    const bool is_empty = coder_.template code<kLeastEmpty>(empties_[context], wanted == 0);
    if (is_empty || tree_.codeword_count() < 2) return 0;
    return code_occupied(around, tile, wanted);
  }

  std::uint16_t code_occupied(const Neighbours& around, std::size_t tile, std::uint16_t wanted) {
    const std::size_t surprise_class = surprise_class_of(around);
    alignas(64) TileCoefficients predicted;
    predict_(inputs_of(around), predicted.data());
    const std::uint16_t codeword =
        code_way(predicted, errors_.octaves(surprise_class), tree_.leaf_of(wanted));
    const TileCoefficients& found = tree_.coefficients(codeword);
    TileCoefficients wrong_by;
    for (std::size_t j = 0; j < kTileElements; ++j)
      wrong_by[j] = std::fabs(found[j] - predicted[j]);
    errors_.learn(surprise_class, wrong_by);
    surprises_[tile] = sum_of(wrong_by) / 4.0f;
    return codeword;
  }

  /// The way from the root to a codeword.
  std::uint16_t code_way(const TileCoefficients& predicted,
                         const std::array<int, kTileElements>& usual,
                         std::uint32_t leaf) {
    std::uint32_t number = 1;
    for (int left = static_cast<int>(std::bit_width(leaf)) - 2;; --left) {
      const CodewordTree::Node& node = tree_.node(number);
      tree_.prefetch_below(number);
      if (node.codeword != 0) return node.codeword;
      const bool is_upper = (leaf >> static_cast<unsigned>(std::max(left, 0)) & 1u) != 0;
      AdaptiveBit& turn = turn_model(node, predicted[node.coefficient], usual[node.coefficient]);
      number *= 2;
      if (coder_.template code<kLeastTurn>(turn, is_upper)) {
        ++number;
        asm("" : "+r"(number));
      }
    }
  }

  AdaptiveBit& turn_model(const CodewordTree::Node& node, float predicted, int usual) {
    const float difference = predicted - node.threshold;
    const int distance =
        std::clamp((quarter_octaves(std::fabs(difference)) - usual + 24) >> 1, 0, 15);
    const int width = std::clamp((node.quarter_octaves - usual + 20) >> 1, 0, 15);
    const auto side = static_cast<std::size_t>(difference < 0.0f ? 16 + distance : 15 - distance);
    return turns_[(side * kWidths + static_cast<std::size_t>(width)) * kOrders +
                  order_of(node.coefficient)];
  }

  /// In four sums side by side, which takes a fourth of the time.
  static float sum_of(const TileCoefficients& values) {
    std::array<float, 4> sums{};
    for (std::size_t j = 0; j < kTileElements; ++j) sums[j % 4] += values[j];
    return (sums[0] + sums[1]) + (sums[2] + sums[3]);
  }

  static std::size_t surprise_class_of(const Neighbours& around) {
    float sum = 0.0f;
    float count = 0.0f;
    for (std::size_t i = 0; i < kSurprising; ++i)
      if (around[i].state == Neighbour::State::Occupied) {
        sum += around[i].surprise;
        count += 1.0f;
      }
    const float mean = count > 0.0f ? sum / count : kFirstSurprise;
    return std::min<std::size_t>(static_cast<std::size_t>(quarter_octaves(mean + 1.0f)) / 4,
                                 kSurpriseClasses - 1);
  }

  /// For a neighbour that is missing, the first one that is there stands in, best one that is not
  /// empty.
  [[nodiscard]] PredictionInputs inputs_of(const Neighbours& around) const {
    static constexpr TileCoefficients kZeros{};
    const float* substitute = kZeros.data();
    for (const auto wanted : {Neighbour::State::Occupied, Neighbour::State::Empty}) {
      const auto* first = std::find_if(
          around.begin(), around.end(), [&](const Neighbour& n) { return n.state == wanted; });
      if (first == around.end()) continue;
      substitute = tree_.coefficients(first->codeword).data();
      break;
    }
    PredictionInputs inputs{};
    for (std::size_t i = 0; i < kPredictors; ++i) {
      const bool is_there = around[i].state != Neighbour::State::Missing;
      const float* own = tree_.coefficients(around[i].codeword).data();
      inputs.plain[i] = is_there ? own : substitute;
      inputs.turned[i] = is_there ? own : kZeros.data();
    }
    return inputs;
  }

  const CodewordTree& tree_;
  const std::array<std::size_t, 4>& tiles_;
  Coder& coder_;
  PredictFunction predict_;
  std::array<std::ptrdiff_t, kPredictors> offsets_{};
  std::vector<float> surprises_;
  UsualErrors errors_;
  std::vector<AdaptiveBit> turns_;
  std::vector<AdaptiveBit> empties_;
};

std::size_t tile_count_of(const std::array<std::size_t, 4>& tiles) {
  return tiles[0] * tiles[1] * tiles[2] * tiles[3];
}

}  // namespace

std::vector<std::uint8_t> IndexCoding::encode(std::span<const std::uint16_t> indices,
                                              const std::array<std::size_t, 4>& tiles) const {
  check(indices.size() == tile_count_of(tiles), "one index per tile");
  check(std::ranges::all_of(indices,
                            [&](std::uint16_t index) { return index < tree_.codeword_count(); }),
        "indices of the codebook");
  std::vector<std::uint16_t> given(indices.begin(), indices.end());
  RangeEncoder coder;
  BlockCoder<RangeEncoder>(tree_, tiles, coder).code(given);
  return coder.finish();
}

bool IndexCoding::decode(std::span<const std::uint8_t> bytes,
                         const std::array<std::size_t, 4>& tiles,
                         std::span<std::uint16_t> indices) const {
  check(indices.size() == tile_count_of(tiles), "one index per tile");
  std::ranges::fill(indices, std::uint16_t{0});
  RangeDecoder coder(bytes);
  BlockCoder<RangeDecoder>(tree_, tiles, coder).code(indices);
  return coder.is_exhausted();
}

}  // namespace af
