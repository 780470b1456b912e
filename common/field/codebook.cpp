// SPDX-License-Identifier: Apache-2.0
#include "field/codebook.h"

#include <numeric>
#include <span>
#include <utility>

namespace af {

namespace {

/// Codeword 0 is no shape.
void fold_shapes(std::span<Tile> codewords) {
  if (codewords.empty()) return;
  for (Tile& shape : codewords.subspan(1)) shape = folded_shape(shape);
}

}  // namespace

std::uint32_t tile_sum(const Tile& tile) {
  return std::accumulate(tile.begin(), tile.end(), std::uint32_t{0});
}

bool codeword_less(const Tile& a, const Tile& b) {
  const std::uint32_t sum_a = tile_sum(a);
  const std::uint32_t sum_b = tile_sum(b);
  return sum_a != sum_b ? sum_a < sum_b : a < b;
}

Tile folded_shape(const Tile& shape) {
  constexpr std::size_t kUpperS = tile_element(0, 0, 1, 0);
  Tile folded = shape;
  for (std::size_t i = 0; i < kTileElements; ++i)
    if ((i & kUpperS) != 0) folded[i] = static_cast<std::uint16_t>(65535 - folded[i]);
  return folded;
}

std::vector<Tile> searched_codewords(const Codebook& codebook) {
  std::vector<Tile> codewords = codebook.codewords;
  if (codebook.has_means()) fold_shapes(codewords);
  return codewords;
}

Codebook codebook_of_searched(std::vector<Tile> codewords, int mean_step) {
  if (mean_step > 0) fold_shapes(codewords);
  return {std::move(codewords), mean_step, {}};
}

TileCoefficients decoded_coefficients(const Codebook& codebook,
                                      std::uint16_t index,
                                      std::uint16_t mean) {
  TileCoefficients coefficients = hadamard_coefficients(codebook.codewords[index]);
  if (codebook.has_means() && index > 0)
    coefficients[0] +=
        static_cast<float>(kTileElements) * static_cast<float>(int{mean} - kShapeZero);
  return coefficients;
}

std::vector<std::string> problems(const Codebook& codebook) {
  std::vector<std::string> found;
  const auto& codewords = codebook.codewords;
  if (codewords.empty() || codewords.size() > kMaxCodewords)
    return {"codewords = " + std::to_string(codewords.size()) + ": must be between 1 and 65536"};
  if (codebook.mean_step < 0 || codebook.mean_step > kMaxMeanStep)
    found.push_back("mean_step = " + std::to_string(codebook.mean_step) +
                    ": must be between 0 and " + std::to_string(kMaxMeanStep));
  if (codebook.filter)
    for (std::string& problem : problems(*codebook.filter)) found.push_back(std::move(problem));
  if (!is_zero(codewords.front())) found.emplace_back("codeword 0 must be the zero tile");
  const std::vector<Tile> ordered = searched_codewords(codebook);
  for (std::size_t i = codebook.has_means() ? 2 : 1; i < ordered.size(); ++i)
    if (codeword_less(ordered[i], ordered[i - 1])) {
      found.push_back("codeword " + std::to_string(i) + " breaks the codebook's order by sum");
      break;
    }
  return found;
}

}  // namespace af
