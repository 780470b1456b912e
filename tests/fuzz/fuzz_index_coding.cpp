// SPDX-License-Identifier: Apache-2.0
// A chunk of coded indices, and the codebook beside it.
#include <algorithm>
#include <array>
#include <vector>

#include "field/compressed_attenuation_field.h"
#include "field/index_coding.h"
#include "fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace af;
  fuzz::InputBytes input(data, size);
  Codebook codebook{{Tile{}}};
  const std::size_t codewords = input.take_below(40);
  for (std::size_t i = 0; i < codewords; ++i) {
    Tile tile{};
    for (std::uint16_t& level : tile) level = input.take<std::uint16_t>();
    codebook.codewords.push_back(tile);
  }
  std::sort(codebook.codewords.begin(), codebook.codewords.end(), codeword_less);
  // The order matters to no coding; a step makes shapes of the codewords.
  if (input.take_below(2) == 1)
    codebook.mean_step = 1 + static_cast<int>(input.take_below(kMaxMeanStep));
  std::array<std::size_t, 4> tiles{};
  for (std::size_t& extent : tiles) extent = 1 + input.take_below(9);
  const IndexCoding coding(codebook);
  const std::size_t rows = coding.values_per_tile();
  std::vector<std::uint16_t> indices(rows * tiles[0] * tiles[1] * tiles[2] * tiles[3]);
  const bool is_accepted = coding.decode(input.rest(), tiles, indices);
  fuzz::require(index_problems(indices, tiles[3], codebook, "a block").empty(),
                "indices and means of the codebook");
  const auto rest = input.rest();
  std::vector<std::uint16_t> again(indices.size());
  std::vector<std::uint16_t> of_half(indices.size());
  std::vector<std::uint16_t> once_more(indices.size());
  const std::array<CodedBlock, 3> together = {
      {{rest, again}, {rest.first(rest.size() / 2), of_half}, {rest, once_more}}};
  const bool are_accepted = coding.decode(together, tiles);
  fuzz::require(again == indices && once_more == indices && !(are_accepted && !is_accepted),
                "blocks decode together as one by one");
  if (!is_accepted) return 0;
  const auto bytes = coding.encode(indices, tiles);
  std::vector<std::uint16_t> back(indices.size());
  fuzz::require(coding.decode(bytes, tiles, back) && back == indices,
                "what was coded is given back");
  return 0;
}
