// SPDX-License-Identifier: Apache-2.0
#include "fuzz/sample_field.h"

#include <cstdint>

namespace af::fuzz {

namespace {

constexpr std::uint16_t kCodewords = 9;

SlabGeometry slab_between(double low_mm, double high_mm) {
  SlabGeometry slab;
  slab.st_plane_y_mm = low_mm < 0.0 ? high_mm : low_mm;
  slab.y_low_mm = low_mm;
  slab.y_high_mm = high_mm;
  slab.s = slab.t = {-200.0, 200.0, 9};
  slab.stored_s = {2, 7};
  slab.stored_t = {2, 4};
  return slab;
}

}  // namespace

CompressedAttenuationField sample_field() {
  CompressedAttenuationField field;
  FieldIdentity& identity = field.identity;
  identity.camera.name = "A";
  identity.camera.source_point = {0.0, -600.0, 0.0};
  identity.camera.detector_origin_point = {-16.0, 400.0, 16.0};
  identity.camera.row_direction = {0.0, 0.0, -1.0};
  identity.camera.size_px = {33, 33};
  identity.range = {0.1, 5.0};
  identity.ct.content_sha256 = std::string(64, 'b');
  field.light_slab.uv_plane_y_mm = 600.0;
  field.light_slab.u = field.light_slab.v = {-100.0, 100.0, 4};
  field.light_slab.slabs = {slab_between(-50.0, 0.0), slab_between(0.0, 50.0)};
  field.quantizer_step = 0.5f;
  for (std::uint16_t level = 0; level < kCodewords; ++level) {
    Tile tile{};
    tile.fill(level);
    field.codebook.codewords.push_back(tile);
  }
  return field;
}

CompressedAttenuationField sample_field_with_means() {
  CompressedAttenuationField field = sample_field();
  field.codebook.mean_step = 64;
  for (std::uint16_t i = 1; i < kCodewords; ++i)
    for (std::size_t k = 0; k < kTileElements; ++k)
      field.codebook.codewords[i][k] =
          static_cast<std::uint16_t>((k & 2u) == 0 ? kShapeZero + i : kShapeZero - i);
  return field;
}

AttenuationAtlas sample_atlas(const CompressedAttenuationField& field) {
  AttenuationAtlas atlas;
  atlas.identity = field.identity;
  atlas.quantizer_step = field.quantizer_step;
  atlas.codebook = field.codebook;
  atlas.members = {{field.identity, field.light_slab}, {field.identity, field.light_slab}};
  constexpr double kBetweenMm = 20.0;
  CameraGeometry& camera = atlas.members[1].identity.camera;
  camera.source_point.x() += kBetweenMm;
  camera.detector_origin_point.x() += kBetweenMm;
  return atlas;
}

std::vector<IndexBlock> sample_blocks(const FieldLattice& lattice, bool has_means) {
  std::vector<IndexBlock> blocks;
  for (std::size_t k = 0; k < lattice.slabs.size(); ++k) {
    const SlabLattice& slab = lattice.slabs[k];
    blocks.push_back({k, {0, 0, 0, 0}, slab.tile_counts(), {}});
    std::vector<std::uint16_t>& values = blocks.back().indices;
    const int row = slab.t.stored.tiles();
    for (int first = 0; first < slab.tile_count(); first += row) {
      for (int tile = first; tile < first + row; ++tile)
        values.push_back(static_cast<std::uint16_t>(tile % kCodewords));
      if (!has_means) continue;
      for (int tile = first; tile < first + row; ++tile)
        values.push_back(static_cast<std::uint16_t>(64 * (tile % kCodewords)));
    }
  }
  return blocks;
}

}  // namespace af::fuzz
