// SPDX-License-Identifier: Apache-2.0
#include "field/compressed_attenuation_field.h"

#include <algorithm>

namespace af {

namespace {

void append_axis_problems(const std::string& name,
                          const GridAxis& axis,
                          std::vector<std::string>& found) {
  if (axis.nodes < 2)
    found.push_back(name + " nodes = " + std::to_string(axis.nodes) + ": must be at least 2");
  if (!(axis.last_mm > axis.first_mm)) found.push_back(name + " axis has no extent");
}

void append_range_problems(const std::string& name,
                           const NodeRange& range,
                           const GridAxis& axis,
                           std::vector<std::string>& found) {
  const bool even = range.begin % 2 == 0 && (range.count % 2 == 0 || range.end() == axis.nodes);
  if (range.begin < 0 || range.count < 1 || range.count > axis.nodes - range.begin || !even)
    found.push_back(name + " stored range [" + std::to_string(range.begin) + ", +" +
                    std::to_string(range.count) + ") is not an even-aligned part of " +
                    std::to_string(axis.nodes) + " nodes");
}

}  // namespace

std::size_t CompressedAttenuationField::tile_count(std::size_t slab) const {
  const SlabGeometry& geometry = light_slab.slabs[slab];
  return static_cast<std::size_t>(tiles_u()) * static_cast<std::size_t>(tiles_v()) *
         static_cast<std::size_t>(geometry.stored_s.tiles()) *
         static_cast<std::size_t>(geometry.stored_t.tiles());
}

float CompressedAttenuationField::node_value(std::size_t slab, const NodeIndex& node) const {
  const SlabGeometry& geometry = light_slab.slabs[slab];
  const int local_s = node.s - geometry.stored_s.begin;
  const int local_t = node.t - geometry.stored_t.begin;
  if (local_s < 0 || local_t < 0 || local_s >= geometry.stored_s.count ||
      local_t >= geometry.stored_t.count)
    return 0.0f;
  const auto at = [](int outer, int count, int inner) {
    return static_cast<std::size_t>(outer) * static_cast<std::size_t>(count) +
           static_cast<std::size_t>(inner);
  };
  const std::size_t uv = at(node.u / 2, tiles_v(), node.v / 2);
  const std::size_t st = at(local_s / 2, geometry.stored_t.tiles(), local_t / 2);
  const std::size_t st_tiles = static_cast<std::size_t>(geometry.stored_s.tiles()) *
                               static_cast<std::size_t>(geometry.stored_t.tiles());
  const Tile& tile = codebook.codewords[slabs[slab].indices[uv * st_tiles + st]];
  const std::size_t element = tile_element(static_cast<unsigned>(node.u) & 1u,
                                           static_cast<unsigned>(node.v) & 1u,
                                           static_cast<unsigned>(local_s) & 1u,
                                           static_cast<unsigned>(local_t) & 1u);
  return quantizer_step * static_cast<float>(tile[element]);
}

std::vector<std::string> problems(const CompressedAttenuationField& field) {
  std::vector<std::string> found = problems(field.codebook);
  if (!(field.quantizer_step > 0.0f)) found.emplace_back("quantizer_step must be positive");
  append_axis_problems("u", field.light_slab.u, found);
  append_axis_problems("v", field.light_slab.v, found);
  if (field.light_slab.slabs.empty()) found.emplace_back("the field has no slab");
  if (field.light_slab.slabs.size() != field.slabs.size())
    found.emplace_back("the field's geometry and its index arrays name different numbers of slabs");
  if (!found.empty()) return found;
  for (std::size_t k = 0; k < field.slabs.size(); ++k) {
    const SlabGeometry& slab = field.light_slab.slabs[k];
    const std::string name = "slab " + std::to_string(k);
    const std::size_t found_before = found.size();
    append_axis_problems(name + " s", slab.s, found);
    append_axis_problems(name + " t", slab.t, found);
    append_range_problems(name + " s", slab.stored_s, slab.s, found);
    append_range_problems(name + " t", slab.stored_t, slab.t, found);
    if (found.size() != found_before) continue;
    const auto indices = field.slabs[k].indices.view();
    if (indices.size() != field.tile_count(k))
      found.push_back(name + " holds " + std::to_string(indices.size()) +
                      " indices: its geometry needs " + std::to_string(field.tile_count(k)));
    else if (*std::max_element(indices.begin(), indices.end()) >= field.codebook.size())
      found.push_back(name + " has an index beyond the " + std::to_string(field.codebook.size()) +
                      " codewords");
  }
  return found;
}

}  // namespace af
