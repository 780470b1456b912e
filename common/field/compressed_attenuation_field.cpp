// SPDX-License-Identifier: Apache-2.0
#include "field/compressed_attenuation_field.h"

#include <algorithm>

namespace af {

float CompressedAttenuationField::node_value(std::size_t slab, const NodeIndex& node) const {
  const std::array<LatticeAxis, 4> axes = lattice(slab).axes();
  const std::array<int, 4> nodes = {node.u, node.v, node.s, node.t};
  std::size_t tile = 0;
  std::array<unsigned, 4> odd{};
  for (std::size_t axis = 0; axis < 4; ++axis) {
    const NodeRange& stored = axes[axis].stored;
    const int local = nodes[axis] - stored.begin;
    if (local < 0 || local >= stored.count) return 0.0f;
    tile = tile * static_cast<std::size_t>(stored.tiles()) + static_cast<std::size_t>(local / 2);
    odd[axis] = static_cast<unsigned>(local) & 1u;
  }
  const Tile& codeword = codebook.codewords[slabs[slab].indices[tile]];
  return quantizer_step *
         static_cast<float>(codeword[tile_element(odd[0], odd[1], odd[2], odd[3])]);
}

std::vector<std::string> problems(const CompressedAttenuationField& field) {
  std::vector<std::string> found = problems(field.codebook);
  if (!(field.quantizer_step > 0.0f)) found.emplace_back("quantizer_step must be positive");
  const std::vector<std::string> of_geometry = problems(field.light_slab);
  found.insert(found.end(), of_geometry.begin(), of_geometry.end());
  const FieldLattice lattice = field.lattice();
  if (lattice.slabs.empty()) found.emplace_back("the field has no slab");
  if (lattice.slabs.size() != field.slabs.size())
    found.emplace_back("the field's geometry and its index arrays name different numbers of slabs");
  if (!found.empty()) return found;
  for (std::size_t k = 0; k < field.slabs.size(); ++k) {
    const std::string name = "slab " + std::to_string(k);
    const auto indices = field.slabs[k].indices.view();
    const auto tiles = static_cast<std::size_t>(lattice.slabs[k].tile_count());
    if (indices.size() != tiles)
      found.push_back(name + " holds " + std::to_string(indices.size()) +
                      " indices: its geometry needs " + std::to_string(tiles));
    else if (*std::max_element(indices.begin(), indices.end()) >= field.codebook.size())
      found.push_back(name + " has an index beyond the " + std::to_string(field.codebook.size()) +
                      " codewords");
  }
  return found;
}

}  // namespace af
