// SPDX-License-Identifier: Apache-2.0
#include "field/codebook.h"

#include <numeric>

namespace af {

std::uint32_t tile_sum(const Tile& tile) {
  return std::accumulate(tile.begin(), tile.end(), std::uint32_t{0});
}

bool codeword_less(const Tile& a, const Tile& b) {
  const std::uint32_t sum_a = tile_sum(a);
  const std::uint32_t sum_b = tile_sum(b);
  return sum_a != sum_b ? sum_a < sum_b : a < b;
}

std::vector<std::string> problems(const Codebook& codebook) {
  std::vector<std::string> found;
  const auto& codewords = codebook.codewords;
  if (codewords.empty() || codewords.size() > kMaxCodewords)
    return {"codewords = " + std::to_string(codewords.size()) + ": must be within 1 and 65536"};
  if (!is_zero(codewords.front())) found.emplace_back("codeword 0 must be the zero tile");
  for (std::size_t i = 1; i < codewords.size(); ++i)
    if (codeword_less(codewords[i], codewords[i - 1])) {
      found.push_back("codeword " + std::to_string(i) + " breaks the codebook's order by sum");
      break;
    }
  return found;
}

}  // namespace af
