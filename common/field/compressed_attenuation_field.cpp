// SPDX-License-Identifier: Apache-2.0
#include "field/compressed_attenuation_field.h"

#include <algorithm>

namespace af {

float CompressedAttenuationField::node_value(std::size_t slab, const NodeIndex& node) const {
  const std::array<LatticeAxis, 4> axes = lattice(slab).axes();
  const std::array<int, 4> nodes = {node.u, node.v, node.s, node.t};
  const std::size_t rows = codebook.values_per_tile();
  std::size_t tile = 0;
  std::array<unsigned, 4> odd{};
  for (std::size_t axis = 0; axis < 4; ++axis) {
    const NodeRange& stored = axes[axis].stored;
    const int local = nodes[axis] - stored.begin;
    if (local < 0 || local >= stored.count) return 0.0f;
    const std::size_t rows_before = axis == 3 ? rows : 1;
    tile = tile * static_cast<std::size_t>(stored.tiles()) * rows_before +
           static_cast<std::size_t>(local / 2);
    odd[axis] = static_cast<unsigned>(local) & 1u;
  }
  const SharedArray<std::uint16_t>& values = slabs[slab].indices;
  const std::uint16_t element =
      codebook.codewords[values[tile]][tile_element(odd[0], odd[1], odd[2], odd[3])];
  const auto row = static_cast<std::size_t>(axes[3].stored.tiles());
  const std::uint16_t level = rows == 1 ? element : level_of(element, values[tile + row]);
  return quantizer_step * static_cast<float>(level);
}

std::vector<std::string> index_problems(std::span<const std::uint16_t> values,
                                        std::size_t row,
                                        const Codebook& codebook,
                                        const std::string& name) {
  const std::size_t stride = codebook.values_per_tile() * row;
  std::vector<std::string> found;
  for (std::size_t at = 0; at < values.size(); at += stride) {
    const auto indices = values.subspan(at, row);
    if (*std::ranges::max_element(indices) >= codebook.size())
      return {name + " has an index beyond the " + std::to_string(codebook.size()) + " codewords"};
    if (!codebook.has_means()) continue;
    const auto means = values.subspan(at + row, row);
    for (std::size_t i = 0; i < row; ++i)
      if (means[i] % codebook.mean_step != 0 || (indices[i] == 0 && means[i] != 0))
        return {name + " has a mean of " + std::to_string(means[i]) + " levels with codeword " +
                std::to_string(indices[i]) + ": means are multiples of " +
                std::to_string(codebook.mean_step) + ", that of codeword 0 is 0"};
  }
  return found;
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
