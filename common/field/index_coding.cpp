// SPDX-License-Identifier: Apache-2.0
#include "field/index_coding.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "base/error.h"
#include "base/vector_width.h"
#include "field/index_coding_kernel.h"

namespace af {

namespace {

std::size_t tile_count_of(const std::array<std::size_t, 4>& tiles) {
  return tiles[0] * tiles[1] * tiles[2] * tiles[3];
}

BlockShape shape_of(const std::array<std::size_t, 4>& tiles) {
  for (const std::size_t extent : tiles)
    check(extent > 0 && extent < std::size_t{std::numeric_limits<std::int32_t>::max()},
          "extents of a block");
  return {static_cast<std::int32_t>(tiles[0]),
          static_cast<std::int32_t>(tiles[1]),
          static_cast<std::int32_t>(tiles[2]),
          static_cast<std::int32_t>(tiles[3])};
}

/// What a coder begins a block with.
class BlockStart {
 public:
  BlockStart(const std::array<std::size_t, 4>& tiles, int mean_step)
      : turns_(std::size_t{kOrders} * kDistances * kWidths),
        empties_(kEmptyContexts),
        notes_(2 * tiles[1] * (tiles[2] + 2) * (tiles[3] + 2) + kNotesBeyond) {
    for (std::size_t c = 0; c < kSurpriseClasses; ++c) {
      errors_[c].fill(std::ldexp(0.6f, static_cast<int>(c)));
      octaves_[c].fill(quarter_octaves(errors_[c][0]));
    }
    if (mean_step == 0) return;
    mean_models_.resize(kMeanModels);
    sums_.resize(notes_.size());
  }

  [[nodiscard]] BlockMemory memory() {
    return {turns_.data(),
            empties_.data(),
            errors_.front().data(),
            octaves_.front().data(),
            notes_.data(),
            mean_models_.data(),
            sums_.data()};
  }

 private:
  std::vector<AdaptiveBit> turns_;
  std::vector<AdaptiveBit> empties_;
  std::array<TileCoefficients, kSurpriseClasses> errors_{};
  std::array<std::array<std::int32_t, kTileElements>, kSurpriseClasses> octaves_{};
  std::vector<TileNote> notes_;
  std::vector<AdaptiveBit> mean_models_;
  std::vector<float> sums_;
};

}  // namespace

std::size_t IndexCoding::most_bytes(std::size_t tiles) {
  // A turn costs 11 bits at most, and a tile has 17 or fewer; a mean has 34 or fewer.
  constexpr std::size_t kOfATile = 72;
  constexpr std::size_t kOfTheEnd = 64;
  return tiles * kOfATile + kOfTheEnd;
}

void IndexCoding::check_values(std::span<const std::uint16_t> values,
                               const std::array<std::size_t, 4>& tiles) const {
  check(values.size() == values_per_tile() * tile_count_of(tiles),
        "values_per_tile() numbers per tile");
  const std::size_t row = tiles[3];
  for (std::size_t at = 0; at < values.size(); at += values_per_tile() * row) {
    const auto indices = values.subspan(at, row);
    check(std::ranges::all_of(indices,
                              [&](std::uint16_t index) { return index < tree_.codeword_count(); }),
          "indices of the codebook");
    if (tree_.mean_step() == 0) continue;
    const auto means = values.subspan(at + row, row);
    for (std::size_t i = 0; i < row; ++i)
      check(means[i] % tree_.mean_step() == 0 && (indices[i] != 0 || means[i] == 0),
            "means are multiples of the step");
  }
}

std::vector<std::uint8_t> IndexCoding::encode(std::span<const std::uint16_t> indices,
                                              const std::array<std::size_t, 4>& tiles) const {
  check_values(indices, tiles);
  const auto bytes =
      std::make_unique_for_overwrite<std::uint8_t[]>(most_bytes(tile_count_of(tiles)));
  BlockStart start(tiles, tree_.mean_step());
  const auto encode_one = select_kernel<EncodeBlock>(
      kernels_128::encode_block, kernels_256::encode_block, kernels_512::encode_block);
  const std::int64_t count =
      encode_one(tree_.tables(), shape_of(tiles), start.memory(), indices.data(), bytes.get());
  return {bytes.get(), bytes.get() + count};
}

bool IndexCoding::decode(std::span<const CodedBlock> blocks,
                         const std::array<std::size_t, 4>& tiles) const {
  const BlockShape shape = shape_of(tiles);
  const auto decode_some = select_kernel<DecodeBlocks>(
      kernels_128::decode_blocks, kernels_256::decode_blocks, kernels_512::decode_blocks);
  bool are_whole = true;
  for (std::size_t first = 0; first < blocks.size(); first += kBlocksAtOnce) {
    const auto some =
        blocks.subspan(first, std::min<std::size_t>(kBlocksAtOnce, blocks.size() - first));
    std::vector<BlockStart> starts(some.size(), BlockStart(tiles, tree_.mean_step()));
    std::array<BlockMemory, kBlocksAtOnce> memories{};
    std::array<BlockToDecode, kBlocksAtOnce> in_memory{};
    for (std::size_t i = 0; i < some.size(); ++i) {
      check(some[i].indices.size() == values_per_tile() * tile_count_of(tiles),
            "values_per_tile() numbers per tile");
      memories[i] = starts[i].memory();
      in_memory[i] = {some[i].indices.data(),
                      some[i].bytes.data(),
                      static_cast<std::int64_t>(some[i].bytes.size()),
                      false};
    }
    decode_some(
        tree_.tables(), shape, memories.data(), in_memory.data(), static_cast<int>(some.size()));
    for (std::size_t i = 0; i < some.size(); ++i)
      are_whole = are_whole && in_memory[i].is_exhausted;
  }
  return are_whole;
}

bool IndexCoding::decode(std::span<const std::uint8_t> bytes,
                         const std::array<std::size_t, 4>& tiles,
                         std::span<std::uint16_t> indices) const {
  const CodedBlock block{bytes, indices};
  return decode(std::span(&block, 1), tiles);
}

}  // namespace af
