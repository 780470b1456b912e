// SPDX-License-Identifier: Apache-2.0
#include "unit/drr/small_fields.h"

#include <algorithm>
#include <cmath>

#include "base/hash_random.h"
#include "geometry/ct_box.h"
#include "geometry/slab_sizing.h"
#include "support/c_arm_camera.h"

namespace af {

CameraGeometry small_camera() {
  return test::c_arm_camera(31, 24, 6.0);
}

double waves(const RayNodes& n) {
  return std::round(30000 + 8000 * std::sin(0.35 * n.s + 0.2 * n.u) * std::cos(0.3 * n.t) +
                    4000 * std::cos(0.5 * n.v + 0.25 * n.t));
}

std::shared_ptr<CompressedAttenuationField> small_field(const FieldFunction& function,
                                                        int slab_count,
                                                        int uv_nodes,
                                                        int st_nodes) {
  auto field = std::make_shared<CompressedAttenuationField>();
  field->identity.camera = small_camera();
  field->identity.range = {8.0 * kRadPerDeg, 20.0};
  LightSlabSpec spec;
  spec.uv_nodes = uv_nodes;
  spec.st_nodes = st_nodes;
  spec.st_plane_y_mm.clear();
  for (int k = 0; k < slab_count; ++k) {
    spec.st_plane_y_mm.push_back(30.0 * k - 15.0 * (slab_count - 1));
    if (k > 0) spec.slab_boundaries_y_mm.push_back(spec.st_plane_y_mm.back() - 15.0);
  }
  const auto everywhere = CtBox{{-300, -300, -300}, {300, 300, 300}}.corner_points();
  field->light_slab = make_light_slab(small_camera(), {}, field->identity.range, everywhere, spec);
  field->quantizer_step = 0.25f;
  field->codebook.codewords.push_back(Tile{});
  for (SlabGeometry& slab : field->light_slab.slabs) {
    // The test's function lives on the whole lattice.
    slab.stored_s = {0, st_nodes};
    slab.stored_t = {0, st_nodes};
    std::vector<std::uint16_t> indices;
    for (int u = 0; u < uv_nodes; u += 2)
      for (int v = 0; v < uv_nodes; v += 2)
        for (int s = 0; s < st_nodes; s += 2)
          for (int t = 0; t < st_nodes; t += 2) {
            Tile tile{};
            for (unsigned e = 0; e < 16; ++e) {
              const int du = static_cast<int>(e >> 3 & 1u);
              const int dv = static_cast<int>(e >> 2 & 1u);
              const int ds = static_cast<int>(e >> 1 & 1u);
              const int dt = static_cast<int>(e & 1u);
              const RayNodes nodes{static_cast<double>(std::min(u + du, uv_nodes - 1)),
                                   static_cast<double>(std::min(v + dv, uv_nodes - 1)),
                                   static_cast<double>(std::min(s + ds, st_nodes - 1)),
                                   static_cast<double>(std::min(t + dt, st_nodes - 1))};
              tile[e] = static_cast<std::uint16_t>(std::lround(function(nodes)));
            }
            indices.push_back(static_cast<std::uint16_t>(field->codebook.size()));
            field->codebook.codewords.push_back(tile);
          }
    field->slabs.push_back({SharedArray<std::uint16_t>(std::move(indices))});
  }
  return field;
}

std::shared_ptr<CompressedAttenuationField> mean_removed(const CompressedAttenuationField& field,
                                                         int mean_step) {
  auto result = std::make_shared<CompressedAttenuationField>(field);
  const auto mean_of = [&](const Tile& tile) {
    return static_cast<int>(tile_sum(tile)) / 16 / mean_step * mean_step;
  };
  const auto shape_of = [&](const Tile& tile) {
    Tile shape = tile;
    for (std::uint16_t& element : shape)
      element = static_cast<std::uint16_t>(element - mean_of(tile) + kShapeZero);
    return shape;
  };
  const auto folded_less = [](const Tile& a, const Tile& b) {
    return codeword_less(folded_shape(a), folded_shape(b));
  };
  std::vector<Tile>& shapes = result->codebook.codewords;
  for (std::size_t i = 1; i < shapes.size(); ++i) shapes[i] = shape_of(shapes[i]);
  std::sort(shapes.begin() + 1, shapes.end(), folded_less);
  shapes.erase(std::unique(shapes.begin() + 1, shapes.end()), shapes.end());
  result->codebook.mean_step = mean_step;
  for (std::size_t k = 0; k < field.slabs.size(); ++k) {
    const auto row = static_cast<std::size_t>(field.lattice(k).t.stored.tiles());
    const auto indices = field.slabs[k].indices.view();
    std::vector<std::uint16_t> values(2 * indices.size());
    for (std::size_t i = 0; i < indices.size(); ++i) {
      if (indices[i] == 0) continue;
      const Tile& tile = field.codebook.codewords[indices[i]];
      const std::size_t at = i / row * 2 * row + i % row;
      const auto found =
          std::lower_bound(shapes.begin() + 1, shapes.end(), shape_of(tile), folded_less);
      values[at] = static_cast<std::uint16_t>(found - shapes.begin());
      values[at + row] = static_cast<std::uint16_t>(mean_of(tile));
    }
    result->slabs[k].indices = SharedArray<std::uint16_t>(std::move(values));
  }
  return result;
}

void crop_stored(CompressedAttenuationField& field, const NodeRange& s, const NodeRange& t) {
  SlabGeometry& slab = field.light_slab.slabs[0];
  const int s_tiles = slab.stored_s.tiles();
  const int t_tiles = slab.stored_t.tiles();
  std::vector<std::uint16_t> indices;
  const SlabLattice lattice = field.lattice(0);
  for (int uv = 0; uv < lattice.u.stored.tiles() * lattice.v.stored.tiles(); ++uv)
    for (int c = 0; c < s.tiles(); ++c)
      for (int d = 0; d < t.tiles(); ++d)
        indices.push_back(field.slabs[0].indices[static_cast<std::size_t>(
            (uv * s_tiles + s.begin / 2 + c) * t_tiles + t.begin / 2 + d)]);
  slab.stored_s = s;
  slab.stored_t = t;
  field.slabs[0].indices = SharedArray<std::uint16_t>(std::move(indices));
}

void crop_viewpoints(CompressedAttenuationField& field, int u_nodes, int v_nodes) {
  const SlabLattice lattice = field.lattice(0);
  const int of_viewpoint = lattice.s.stored.tiles() * lattice.t.stored.tiles();
  const auto crop = [](GridAxis& axis, int nodes) {
    axis.last_mm = axis.position_mm(nodes - 1);
    axis.nodes = nodes;
  };
  crop(field.light_slab.u, u_nodes);
  crop(field.light_slab.v, v_nodes);
  std::vector<std::uint16_t> indices;
  for (int u = 0; u < field.lattice(0).u.stored.tiles(); ++u)
    for (int v = 0; v < field.lattice(0).v.stored.tiles(); ++v) {
      const int first = (u * lattice.v.stored.tiles() + v) * of_viewpoint;
      for (int i = 0; i < of_viewpoint; ++i)
        indices.push_back(field.slabs[0].indices[static_cast<std::size_t>(first + i)]);
    }
  field.slabs[0].indices = SharedArray<std::uint16_t>(std::move(indices));
}

PoseParameters small_pose(std::uint64_t index) {
  HashRandom random(17, index);
  PoseParameters parameters;
  for (int i = 0; i < 3; ++i) {
    parameters.rotation_rad[i] = 8.0 * kRadPerDeg * random.uniform(-1, 1);
    parameters.translation_mm[i] = 20.0 * random.uniform(-1, 1);
  }
  return parameters;
}

RigidTransform pose_partly_outside() {
  PoseParameters far;
  far.translation_mm = {80.0, 0.0, -30.0};
  return pose_from_parameters({}, far);
}

}  // namespace af
