// SPDX-License-Identifier: Apache-2.0
#include "field/compressed_attenuation_field.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace af {

namespace {

/// The tiles of one slab by their numbers along the axes.
class SlabTiles {
 public:
  SlabTiles(const CompressedAttenuationField& field, std::size_t slab)
      : codebook_(field.codebook),
        values_(field.slabs[slab].indices.view()),
        counts_(field.lattice(slab).tile_counts()) {}

  [[nodiscard]] std::uint16_t index(const std::array<int, 4>& tile) const {
    return values_[position(tile)];
  }
  /// 0 where tiles have none.
  [[nodiscard]] std::uint16_t mean(const std::array<int, 4>& tile) const {
    return codebook_.has_means() ? values_[position(tile) + row()] : std::uint16_t{0};
  }
  /// Coefficients of a neighbour as decoded, before levels are limited.
  [[nodiscard]] TileCoefficients coefficients(const std::array<int, 4>& tile,
                                              const TileOffset& offset) const {
    const auto at = neighbouring_tile(tile, offset, counts_);
    return at ? decoded_coefficients(codebook_, index(*at), mean(*at)) : TileCoefficients{};
  }

 private:
  [[nodiscard]] std::size_t row() const { return static_cast<std::size_t>(counts_[3]); }
  [[nodiscard]] std::size_t position(const std::array<int, 4>& tile) const {
    std::size_t rows = 0;
    for (std::size_t axis = 0; axis < 3; ++axis)
      rows = rows * static_cast<std::size_t>(counts_[axis]) + static_cast<std::size_t>(tile[axis]);
    return rows * codebook_.values_per_tile() * row() + static_cast<std::size_t>(tile[3]);
  }

  const Codebook& codebook_;
  std::span<const std::uint16_t> values_;
  std::array<int, 4> counts_;
};

/// A level of a tile by a codebook's filter. This is the definition, and slow; FieldLevel computes
/// all levels.
double filtered_level(const SlabTiles& tiles,
                      const TileFilter& filter,
                      const std::array<int, 4>& tile,
                      std::size_t element) {
  std::map<TileOffset, TileCoefficients> decoded;
  const auto coefficient = [&](const TileOffset& offset, std::size_t k) {
    auto [at, is_new] = decoded.try_emplace(offset);
    if (is_new) at->second = tiles.coefficients(tile, offset);
    return static_cast<double>(at->second[k]);
  };
  double level = 0.0;
  bool is_empty = true;
  for (std::size_t j = 0; j < kTileElements; ++j) {
    double estimate = coefficient({}, j);
    is_empty = is_empty && estimate == 0.0;
    const auto inputs = filter_inputs<double>(j, coefficient);
    for (std::size_t i = 0; i < kFilterInputs; ++i)
      estimate += static_cast<double>(filter.weights[j][i]) * inputs[i];
    const bool is_negated = __builtin_parityll(j & element) != 0;
    level += is_negated ? -estimate : estimate;
  }
  if (is_empty) return 0.0;
  constexpr double kLargestLevel = 65535.0;
  return std::clamp(
      std::floor(level / static_cast<double>(kTileElements) + 0.5), 0.0, kLargestLevel);
}

/// Has no branches, so that compilers vectorise it.
std::uint16_t largest(std::span<const std::uint16_t> values) {
  std::uint16_t result = 0;
  for (const std::uint16_t value : values) result = std::max(result, value);
  return result;
}

/// Whether means are multiples of `step`, and 0 where the index is 0. Multiplies by the step's
/// reciprocal, rounded up to 2^-32, which divides any 16-bit number exactly.
bool are_means(std::span<const std::uint16_t> indices,
               std::span<const std::uint16_t> means,
               std::uint32_t step) {
  const std::uint64_t reciprocal = (std::uint64_t{1} << 32u) / step + 1;
  std::uint32_t wrong = 0;
  for (std::size_t i = 0; i < means.size(); ++i) {
    const std::uint32_t mean = means[i];
    const auto multiple = static_cast<std::uint32_t>((mean * reciprocal) >> 32u) * step;
    wrong |= (mean ^ multiple) | (indices[i] == 0 ? mean : 0u);
  }
  return wrong == 0;
}

}  // namespace

float CompressedAttenuationField::node_value(std::size_t slab, const NodeIndex& node) const {
  const std::array<LatticeAxis, 4> axes = lattice(slab).axes();
  const std::array<int, 4> nodes = {node.u, node.v, node.s, node.t};
  std::array<int, 4> tile{};
  std::array<unsigned, 4> odd{};
  for (std::size_t axis = 0; axis < 4; ++axis) {
    const NodeRange& stored = axes[axis].stored;
    const int local = nodes[axis] - stored.begin;
    if (local < 0 || local >= stored.count) return 0.0f;
    tile[axis] = local / 2;
    odd[axis] = static_cast<unsigned>(local) & 1u;
  }
  const std::size_t number = tile_element(odd[0], odd[1], odd[2], odd[3]);
  const SlabTiles tiles(*this, slab);
  if (codebook.filter)
    return quantizer_step *
           static_cast<float>(filtered_level(tiles, *codebook.filter, tile, number));
  const std::uint16_t element = codebook.codewords[tiles.index(tile)][number];
  const std::uint16_t level = codebook.has_means() ? level_of(element, tiles.mean(tile)) : element;
  return quantizer_step * static_cast<float>(level);
}

std::vector<std::string> index_problems(std::span<const std::uint16_t> values,
                                        std::size_t row,
                                        const Codebook& codebook,
                                        const std::string& name) {
  const std::size_t stride = codebook.values_per_tile() * row;
  for (std::size_t at = 0; at < values.size(); at += stride) {
    const auto indices = values.subspan(at, row);
    if (largest(indices) >= codebook.size())
      return {name + " has an index beyond the " + std::to_string(codebook.size()) + " codewords"};
    if (!codebook.has_means()) continue;
    const auto means = values.subspan(at + row, row);
    const auto step = static_cast<std::uint32_t>(codebook.mean_step);
    if (are_means(indices, means, step)) continue;
    for (std::size_t i = 0; i < row; ++i)
      if (means[i] % step != 0 || (indices[i] == 0 && means[i] != 0))
        return {name + " has a mean of " + std::to_string(means[i]) + " levels with codeword " +
                std::to_string(indices[i]) + ": means are multiples of " + std::to_string(step) +
                ", that of codeword 0 is 0"};
  }
  return {};
}

std::vector<std::string> problems(const CompressedAttenuationField& field) {
  std::vector<std::string> found = problems(field.codebook);
  const auto append = [](const std::vector<std::string>& more, std::vector<std::string>& to) {
    to.insert(to.end(), more.begin(), more.end());
  };
  if (!(field.quantizer_step > 0.0f)) found.emplace_back("quantizer_step must be positive");
  append(problems(field.light_slab), found);
  const FieldLattice lattice = field.lattice();
  if (lattice.slabs.empty()) found.emplace_back("the field has no slab");
  if (lattice.slabs.size() != field.slabs.size())
    found.emplace_back("the field's geometry and its index arrays name different numbers of slabs");
  if (!found.empty()) return found;
  for (std::size_t k = 0; k < field.slabs.size(); ++k) {
    const std::string name = "slab " + std::to_string(k);
    const auto values = field.slabs[k].indices.view();
    const auto tiles = static_cast<std::size_t>(lattice.slabs[k].tile_count());
    const std::size_t needed = field.codebook.values_per_tile() * tiles;
    const auto row = static_cast<std::size_t>(lattice.slabs[k].t.stored.tiles());
    if (values.size() != needed)
      found.push_back(name + " holds " + std::to_string(values.size()) +
                      (field.codebook.has_means() ? " indices and means" : " indices") +
                      ": its geometry needs " + std::to_string(needed));
    else
      append(index_problems(values, row, field.codebook, name), found);
  }
  return found;
}

}  // namespace af
