// SPDX-License-Identifier: Apache-2.0
#include "drr/field_level.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/vector_width.h"
#include "drr/field_level_kernel.h"
#include "drr/filtered_decoding.h"
#include "drr/slab_merging.h"

namespace af {

namespace {

/// All coarse nodes that a stored node of the level below affects.
NodeRange halved_range(const NodeRange& fine, const GridAxis& coarse) {
  const int begin = std::max(0, fine.begin - 1) / 2;
  const int end = std::min(coarse.nodes, fine.end() / 2 + 1);
  return {begin, end - begin};
}

SlabGeometry halved_geometry(const SlabGeometry& fine) {
  SlabGeometry coarse = fine;
  coarse.s = halved_axis(fine.s, "s");
  coarse.t = halved_axis(fine.t, "t");
  coarse.stored_s = halved_range(fine.stored_s, coarse.s);
  coarse.stored_t = halved_range(fine.stored_t, coarse.t);
  return coarse;
}

/// Samples of one viewpoint of the level below, [t][s], with the border that halving reads.
class BorderedPlane {
 public:
  BorderedPlane(const SlabGeometry& fine, const SlabGeometry& coarse)
      : fine_(fine),
        first_s_(2 * coarse.stored_s.begin - 1),
        first_t_(2 * coarse.stored_t.begin - 1),
        width_(2 * coarse.stored_s.count + 2),
        height_(2 * coarse.stored_t.count + 2),
        samples_(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_)) {}

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] const std::uint16_t* samples() const { return samples_.data(); }
  /// Where the first stored sample is.
  [[nodiscard]] std::uint16_t* stored() {
    return at(fine_.stored_s.begin - first_s_, fine_.stored_t.begin - first_t_);
  }

  /// Nodes beyond the lattice take the value of its outermost node.
  void replicate_edges() {
    const int s_end = std::min(width_, fine_.s.nodes - first_s_);
    const int t_end = std::min(height_, fine_.t.nodes - first_t_);
    for (int row = 0; row < t_end; ++row) {
      if (first_s_ < 0) *at(0, row) = *at(1, row);
      std::fill(at(s_end, row), at(0, row) + width_, *at(s_end - 1, row));
    }
    if (first_t_ < 0) std::copy_n(at(0, 1), width_, at(0, 0));
    for (int row = t_end; row < height_; ++row) std::copy_n(at(0, t_end - 1), width_, at(0, row));
  }

 private:
  [[nodiscard]] std::uint16_t* at(int column, int row) {
    return samples_.data() + static_cast<std::ptrdiff_t>(row) * width_ + column;
  }

  SlabGeometry fine_;
  int first_s_;
  int first_t_;
  int width_;
  int height_;
  std::vector<std::uint16_t> samples_;
};

SampleExtent extent_of(const LightSlab& field_geometry, const SlabGeometry& slab) {
  return {field_geometry.u.nodes,
          field_geometry.v.nodes,
          static_cast<std::size_t>(slab.stored_s.count) *
              static_cast<std::size_t>(slab.stored_t.count)};
}

/// A viewpoint of a tile, and where its samples go.
struct TileViewpoint {
  int u, v;
  std::uint16_t* samples;
};

/// Viewpoint i = 2 du + dv of tile (a, b). It has no samples where it pads the last tiles.
TileViewpoint viewpoint_of_tile(
    const SampleExtent& extent, int a, int b, int i, std::span<std::uint16_t> samples) {
  const int u = 2 * a + i / 2;
  const int v = 2 * b + i % 2;
  if (u >= extent.u_nodes || v >= extent.v_nodes) return {u, v, nullptr};
  const auto viewpoint = static_cast<std::size_t>(u * extent.v_nodes + v);
  return {u, v, samples.data() + viewpoint * extent.per_viewpoint};
}

/// Halves one bordered plane into a viewpoint's samples.
class Halving {
 public:
  explicit Halving(const SlabGeometry& coarse)
      : rows_(coarse.stored_t.count),
        columns_(coarse.stored_s.count),
        sums_(2 * static_cast<std::size_t>(columns_) + 2),
        halve_plane_(select_kernel<HalvePlane>(
            kernels_128::halve_plane, kernels_256::halve_plane, kernels_512::halve_plane)) {}

  void operator()(BorderedPlane& plane, std::uint16_t* samples) {
    plane.replicate_edges();
    halve_plane_(plane.samples(), plane.width(), rows_, columns_, sums_.data(), samples);
  }

 private:
  int rows_;
  int columns_;
  std::vector<std::uint32_t> sums_;
  HalvePlane halve_plane_;
};

/// Decodes viewpoint tiles of a slab whose tiles have no filter. Gives level 0 or, halved, level 1.
class TileDecoding {
 public:
  TileDecoding(std::shared_ptr<const CompressedAttenuationField> field,
               std::size_t slab,
               const SlabGeometry& coarse,
               int level)
      : field_(std::move(field)),
        slab_(slab),
        fine_(field_->light_slab.slabs[slab]),
        coarse_(coarse),
        level_(level) {}

  void operator()(int a, int b, std::span<std::uint16_t> samples) const {
    const SampleExtent extent = extent_of(field_->light_slab, level_ > 0 ? coarse_ : fine_);
    const BorderedPlane plane(fine_, coarse_);
    std::array planes{plane, plane, plane, plane};
    std::array<std::uint16_t*, 4> decoded{};
    for (std::size_t i = 0; i < 4; ++i)
      if (viewpoint_of_tile(extent, a, b, static_cast<int>(i), samples).samples != nullptr)
        decoded[i] = planes[i].stored();
    select_kernel<DecodeTiles>(
        kernels_128::decode_tiles, kernels_256::decode_tiles, kernels_512::decode_tiles)(
        tile_plane(a, b), plane.width(), decoded.data());
    Halving halve(coarse_);
    for (std::size_t i = 0; i < 4; ++i) {
      if (decoded[i] == nullptr) continue;
      std::uint16_t* const to =
          viewpoint_of_tile(extent, a, b, static_cast<int>(i), samples).samples;
      if (level_ > 0) {
        halve(planes[i], to);
        continue;
      }
      for (int row = 0; row < fine_.stored_t.count; ++row)
        std::copy_n(decoded[i] + static_cast<std::ptrdiff_t>(row) * plane.width(),
                    fine_.stored_s.count,
                    to + static_cast<std::ptrdiff_t>(row) * fine_.stored_s.count);
    }
  }

 private:
  [[nodiscard]] TilePlane tile_plane(int a, int b) const {
    const SlabLattice lattice = field_->lattice(slab_);
    const Codebook& codebook = field_->codebook;
    const auto st_values = static_cast<std::size_t>(lattice.s.stored.tiles()) *
                           static_cast<std::size_t>(lattice.t.stored.tiles()) *
                           codebook.values_per_tile();
    const auto uv_tile = static_cast<std::size_t>(a * lattice.v.stored.tiles() + b);
    return {field_->slabs[slab_].indices.data() + uv_tile * st_values,
            codebook.codewords.data()->data(),
            fine_.stored_s.tiles(),
            fine_.stored_t.tiles(),
            codebook.has_means()};
  }

  std::shared_ptr<const CompressedAttenuationField> field_;
  std::size_t slab_;
  SlabGeometry fine_;
  SlabGeometry coarse_;
  int level_;
};

/// Halves viewpoint tiles of one slab of the level below.
class TileHalving {
 public:
  TileHalving(std::shared_ptr<const FieldLevel> from, std::size_t slab, const SlabGeometry& coarse)
      : from_(std::move(from)), slab_(from_->slabs[slab]), coarse_(coarse) {}

  void operator()(int a, int b, std::span<std::uint16_t> samples) const {
    const SlabGeometry& fine = slab_.geometry;
    const SampleExtent extent = extent_of(from_->field_geometry, coarse_);
    BorderedPlane plane(fine, coarse_);
    Halving halve(coarse_);
    for (int i = 0; i < 4; ++i) {
      const TileViewpoint to = viewpoint_of_tile(extent, a, b, i, samples);
      if (to.samples == nullptr) continue;
      const std::uint16_t* const source = slab_.samples.viewpoints(to.u, to.v);
      for (int row = 0; row < fine.stored_t.count; ++row)
        std::copy_n(source + static_cast<std::ptrdiff_t>(row) * fine.stored_s.count,
                    fine.stored_s.count,
                    plane.stored() + static_cast<std::ptrdiff_t>(row) * plane.width());
      halve(plane, to.samples);
    }
  }

 private:
  std::shared_ptr<const FieldLevel> from_;
  const FieldLevelSlab& slab_;
  SlabGeometry coarse_;
};

/// The sum of a slab's levels as its codewords have them, including padded tiles.
double codeword_levels(const CompressedAttenuationField& field, std::size_t slab) {
  const Codebook& codebook = field.codebook;
  const bool has_means = codebook.has_means();
  std::vector<std::int64_t> sums;
  for (const Tile& codeword : codebook.codewords) {
    const std::int64_t sum = std::accumulate(codeword.begin(), codeword.end(), std::int64_t{0});
    sums.push_back(has_means ? sum - static_cast<std::int64_t>(kTileElements) * kShapeZero : sum);
  }
  const auto row = static_cast<std::size_t>(field.lattice(slab).t.stored.tiles());
  const std::span<const std::uint16_t> values = field.slabs[slab].indices.view();
  std::int64_t total = 0;
  for (std::size_t at = 0; at < values.size(); at += codebook.values_per_tile() * row)
    for (std::size_t i = at; i < at + row; ++i) {
      if (values[i] == 0) continue;
      total += sums[values[i]];
      if (has_means) total += static_cast<std::int64_t>(kTileElements) * values[i + row];
    }
  return static_cast<double>(total);
}

/// Level 0 or 1 of a field, slab by slab. `make_tile(slab, its halved geometry)` makes its tiles.
template <typename MakeTile>
FieldLevel decoded_slabs(const CompressedAttenuationField& field,
                         int level,
                         const FieldLevelMemory& memory,
                         const MakeTile& make_tile) {
  FieldLevel result{level, field.light_slab, field.quantizer_step, {}};
  for (std::size_t k = 0; k < field.slabs.size(); ++k) {
    const SlabGeometry& fine = field.light_slab.slabs[k];
    const SlabGeometry geometry = level == 0 ? fine : halved_geometry(fine);
    result.slabs.push_back({geometry,
                            {extent_of(field.light_slab, geometry), memory, make_tile(k)},
                            field.slabs.size() > 1 ? codeword_levels(field, k) : 1.0});
  }
  return result;
}

FieldLevel decoded_level(const std::shared_ptr<const CompressedAttenuationField>& field,
                         int level,
                         const FieldLevelMemory& memory) {
  check(!field->codebook.filter, "tiles without a filter");
  return decoded_slabs(*field, level, memory, [&](std::size_t k) {
    return TileDecoding(field, k, halved_geometry(field->light_slab.slabs[k]), level);
  });
}

/// Level 0 of a field whose codebook has a filter.
FieldLevel filtered_level_0(const std::shared_ptr<const CompressedAttenuationField>& field,
                            const FieldLevelMemory& memory) {
  const auto decoding = std::make_shared<const FilteredDecoding>(field);
  return decoded_slabs(*field, 0, memory, [&](std::size_t k) {
    return [decoding, k](int a, int b, std::span<std::uint16_t> samples) {
      decoding->decode(k, a, b, samples);
    };
  });
}

FieldLevelSlab halved_slab(const std::shared_ptr<const FieldLevel>& from,
                           std::size_t slab,
                           const FieldLevelMemory& memory) {
  const SlabGeometry geometry = halved_geometry(from->slabs[slab].geometry);
  return {geometry,
          {extent_of(from->field_geometry, geometry), memory, TileHalving(from, slab, geometry)},
          from->slabs[slab].weight};
}

/// Merges two slabs from `first` on.
FieldLevelSlab merged_slab(const std::shared_ptr<const FieldLevel>& from,
                           std::size_t first,
                           const FieldLevelMemory& memory) {
  const std::span slabs = std::span(from->slabs).subspan(first, 2);
  const auto merging = std::make_shared<const SlabMerging>(from->field_geometry, slabs);
  const SampleExtent extent = extent_of(from->field_geometry, merging->geometry());
  const auto make_tile = [from, merging, extent](int a, int b, std::span<std::uint16_t> samples) {
    for (int i = 0; i < 4; ++i)
      if (const TileViewpoint to = viewpoint_of_tile(extent, a, b, i, samples);
          to.samples != nullptr)
        merging->merge(to.u, to.v, {to.samples, extent.per_viewpoint});
  };
  return {merging->geometry(), {extent, memory, make_tile}, slabs[0].weight + slabs[1].weight};
}

/// Memory for a level. Levels up to `stepping_stones` lie in memory of this process.
FieldLevelMemory memory_of(int level, const FieldLevelMemory& memory, int stepping_stones) {
  return level <= stepping_stones ? process_memory() : memory;
}

/// Levels 1 to coarsest_level, each made from the one before.
FieldLevels pyramid_from(FieldLevel level_1,
                         int coarsest_level,
                         const FieldLevelMemory& memory,
                         int stepping_stones) {
  check(coarsest_level >= 1, "a pyramid begins at level 1");
  FieldLevels levels{std::make_shared<const FieldLevel>(std::move(level_1))};
  for (int level = 2; level <= coarsest_level; ++level)
    levels.push_back(std::make_shared<const FieldLevel>(
        next_field_level(levels.back(), memory_of(level, memory, stepping_stones))));
  return levels;
}

}  // namespace

GridAxis halved_axis(const GridAxis& axis, const char* name) {
  const int nodes = (axis.nodes + 1) / 2;
  if (nodes < 2)
    throw InputError(std::string(name) + " nodes of a field level",
                     std::to_string(axis.nodes),
                     "too few to halve: must be at least 3");
  const double first_mm = axis.first_mm + 0.5 * axis.spacing_mm();
  return {first_mm, first_mm + 2.0 * axis.spacing_mm() * (nodes - 1), nodes};
}

double level_blur_sigma_in_nodes(int level, bool with_resampling) {
  const double variance_per_step = 1.0 / 4.0 + (with_resampling ? 1.0 / 6.0 : 0.0);
  return std::sqrt((std::pow(4.0, level) - 1.0) * variance_per_step);
}

double node_spacing_mm(const LightSlab& light_slab) {
  double sum_mm = 0.0;
  for (const SlabGeometry& slab : light_slab.slabs) {
    const double scale = light_slab.uv_plane_y_mm / (light_slab.uv_plane_y_mm - slab.st_plane_y_mm);
    sum_mm += scale * 0.5 * (slab.s.spacing_mm() + slab.t.spacing_mm());
  }
  return sum_mm / static_cast<double>(light_slab.slabs.size());
}

int halvings_to_usual_nodes(const LightSlab& light_slab) {
  int nodes = 0;
  for (const SlabGeometry& slab : light_slab.slabs)
    nodes = std::max({nodes, slab.s.nodes, slab.t.nodes});
  constexpr double kUsualNodes = 256.0;
  constexpr double kUsualSpacingMm = 1.1;
  const double halvings = std::min(std::log2(nodes / kUsualNodes),
                                   std::log2(kUsualSpacingMm / node_spacing_mm(light_slab)));
  return std::max(0, static_cast<int>(std::lround(halvings)));
}

float FieldLevel::node_value(std::size_t slab, const NodeIndex& node) const {
  const FieldLevelSlab& of_slab = slabs[slab];
  const NodeRange& s = of_slab.geometry.stored_s;
  const NodeRange& t = of_slab.geometry.stored_t;
  if (node.s < s.begin || node.s >= s.end() || node.t < t.begin || node.t >= t.end()) return 0.0f;
  const auto of_viewpoint =
      static_cast<std::size_t>(node.t - t.begin) * static_cast<std::size_t>(s.count) +
      static_cast<std::size_t>(node.s - s.begin);
  return quantizer_step *
         static_cast<float>(of_slab.samples.viewpoints(node.u, node.v)[of_viewpoint]);
}

double FieldLevel::blur_sigma_mm(bool with_resampling) const {
  return level_blur_sigma_in_nodes(level, with_resampling) * node_spacing_mm(field_geometry);
}

std::size_t decoded_bytes(const CompressedAttenuationField& field) {
  return static_cast<std::size_t>(field.lattice().tile_count()) * sizeof(Tile);
}

FieldLevel decode_field(const std::shared_ptr<const CompressedAttenuationField>& field,
                        const FieldLevelMemory& memory) {
  return field->codebook.filter ? filtered_level_0(field, memory) : decoded_level(field, 0, memory);
}

FieldLevel decode_halved_field(const std::shared_ptr<const CompressedAttenuationField>& field,
                               const FieldLevelMemory& memory) {
  check(field->slabs.size() == 1, "several slabs are merged from their decoded samples");
  if (!field->codebook.filter) return decoded_level(field, 1, memory);
  return next_field_level(std::make_shared<const FieldLevel>(decode_field(field)), memory);
}

FieldLevel next_field_level(const std::shared_ptr<const FieldLevel>& level,
                            const FieldLevelMemory& memory) {
  FieldLevel result{level->level + 1, level->field_geometry, level->quantizer_step, {}};
  // Level 1 keeps the slabs. With half the nodes they bear half the parallax, in nodes, and so do
  // the merged slabs of all further levels.
  const std::size_t together = result.level == 1 ? 1 : 2;
  for (std::size_t k = 0; k < level->slabs.size(); k += together)
    result.slabs.push_back(k + together <= level->slabs.size() && together == 2
                               ? merged_slab(level, k, memory)
                               : halved_slab(level, k, memory));
  return result;
}

FieldLevels make_field_pyramid(const std::shared_ptr<const CompressedAttenuationField>& field,
                               int coarsest_level,
                               const FieldLevelMemory& memory,
                               int stepping_stones) {
  if (field->slabs.size() > 1)
    return make_field_pyramid(std::make_shared<const FieldLevel>(decode_field(field)),
                              coarsest_level,
                              memory,
                              stepping_stones);
  return pyramid_from(decode_halved_field(field, memory_of(1, memory, stepping_stones)),
                      coarsest_level,
                      memory,
                      stepping_stones);
}

FieldLevels make_field_pyramid(const std::shared_ptr<const FieldLevel>& level_0,
                               int coarsest_level,
                               const FieldLevelMemory& memory,
                               int stepping_stones) {
  return pyramid_from(next_field_level(level_0, memory_of(1, memory, stepping_stones)),
                      coarsest_level,
                      memory,
                      stepping_stones);
}

}  // namespace af
