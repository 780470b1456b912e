// SPDX-License-Identifier: Apache-2.0
#include "drr/field_level.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "base/error.h"
#include "base/thread_pool.h"
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

/// A part's share of `count` units.
struct Share {
  int begin, end;
};

Share share_of(int count, int part, int parts) {
  const auto edge = [&](int i) {
    return static_cast<int>(static_cast<std::int64_t>(count) * i / parts);
  };
  return {edge(part), edge(part + 1)};
}

/// Where the samples of viewpoint (u, v) begin; null when the tiles' padding goes beyond the last
/// viewpoint.
std::uint16_t* viewpoint_samples(const SlabLattice& lattice,
                                 int u,
                                 int v,
                                 std::size_t samples_per_viewpoint,
                                 std::span<std::uint16_t> samples) {
  if (u >= lattice.u.nodes || v >= lattice.v.nodes) return nullptr;
  const auto viewpoint = static_cast<std::size_t>(u) * static_cast<std::size_t>(lattice.v.nodes) +
                         static_cast<std::size_t>(v);
  return samples.data() + viewpoint * samples_per_viewpoint;
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

/// Decodes a share of one slab's viewpoints, halved when `level` is 1.
void decode_slab(const CompressedAttenuationField& field,
                 std::size_t k,
                 const FieldLevelSlab& to,
                 int level,
                 Share u_tiles,
                 std::span<std::uint16_t> samples) {
  const SlabGeometry& fine = field.light_slab.slabs[k];
  const auto decode_tiles = select_kernel<DecodeTiles>(
      kernels_128::decode_tiles, kernels_256::decode_tiles, kernels_512::decode_tiles);
  const SlabGeometry coarse = halved_geometry(fine);
  std::array<BorderedPlane, 4> planes{BorderedPlane(fine, coarse),
                                      BorderedPlane(fine, coarse),
                                      BorderedPlane(fine, coarse),
                                      BorderedPlane(fine, coarse)};
  Halving halve(coarse);
  const SlabLattice lattice = field.lattice(k);
  const int v_tiles = lattice.v.stored.tiles();
  const bool has_means = field.codebook.has_means();
  const auto st_values = static_cast<std::size_t>(lattice.s.stored.tiles()) *
                         static_cast<std::size_t>(lattice.t.stored.tiles()) *
                         field.codebook.values_per_tile();
  for (int a = u_tiles.begin; a < u_tiles.end; ++a)
    for (int b = 0; b < v_tiles; ++b) {
      std::array<std::uint16_t*, 4> targets{};
      std::array<std::uint16_t*, 4> decoded{};
      for (int i = 0; i < 4; ++i) {
        const auto at = static_cast<std::size_t>(i);
        targets[at] = viewpoint_samples(
            lattice, 2 * a + i / 2, 2 * b + i % 2, to.samples_per_viewpoint(), samples);
        if (targets[at] != nullptr) decoded[at] = planes[at].stored();
      }
      const std::size_t uv_tile = static_cast<std::size_t>(a) * static_cast<std::size_t>(v_tiles) +
                                  static_cast<std::size_t>(b);
      decode_tiles({field.slabs[k].indices.data() + uv_tile * st_values,
                    field.codebook.codewords.data()->data(),
                    fine.stored_s.tiles(),
                    fine.stored_t.tiles(),
                    has_means},
                   planes[0].width(),
                   decoded.data());
      for (std::size_t i = 0; i < 4; ++i) {
        if (targets[i] == nullptr) continue;
        if (level > 0) {
          halve(planes[i], targets[i]);
          continue;
        }
        for (int row = 0; row < fine.stored_t.count; ++row)
          std::copy_n(planes[i].stored() + static_cast<std::ptrdiff_t>(row) * planes[i].width(),
                      fine.stored_s.count,
                      targets[i] + static_cast<std::ptrdiff_t>(row) * fine.stored_s.count);
      }
    }
}

/// Halves a share of one slab's viewpoints.
void halve_slab(const FieldLevelSlab& from,
                const FieldLevelSlab& to,
                Share viewpoints,
                std::span<std::uint16_t> samples) {
  const SlabGeometry& fine = from.geometry;
  BorderedPlane plane(fine, to.geometry);
  Halving halve(to.geometry);
  for (int viewpoint = viewpoints.begin; viewpoint < viewpoints.end; ++viewpoint) {
    const auto at = static_cast<std::size_t>(viewpoint);
    const std::uint16_t* source = from.samples.data() + at * from.samples_per_viewpoint();
    for (int row = 0; row < fine.stored_t.count; ++row)
      std::copy_n(source + static_cast<std::ptrdiff_t>(row) * fine.stored_s.count,
                  fine.stored_s.count,
                  plane.stored() + static_cast<std::ptrdiff_t>(row) * plane.width());
    halve(plane, samples.data() + at * to.samples_per_viewpoint());
  }
}

/// The samples of one slab of a level, filled in parts, and their padding.
SharedArray<std::uint16_t> padded_samples(const FieldLevel& level,
                                          const FieldLevelSlab& slab,
                                          const FieldLevelMemory& memory,
                                          const FieldLevelFill& fill) {
  const std::size_t count = level.viewpoint_count() * slab.samples_per_viewpoint();
  return memory(count + kFieldLevelPadding,
                [&](std::span<std::uint16_t> samples, int part, int parts) {
                  if (part == 0) std::ranges::fill(samples.subspan(count), std::uint16_t{0});
                  fill(samples.first(count), part, parts);
                });
}

/// Level 0 or 1 of a field, slab by slab: decode(k, slab, samples, part, parts).
template <typename Decode>
FieldLevel decoded_slabs(const CompressedAttenuationField& field,
                         int level,
                         const FieldLevelMemory& memory,
                         const Decode& decode) {
  FieldLevel result{level, field.light_slab, field.quantizer_step, {}};
  for (std::size_t k = 0; k < field.slabs.size(); ++k) {
    const SlabGeometry& fine = field.light_slab.slabs[k];
    FieldLevelSlab slab{level == 0 ? fine : halved_geometry(fine), {}};
    slab.samples = padded_samples(result, slab, memory, [&](auto samples, int part, int parts) {
      decode(k, slab, samples, part, parts);
    });
    result.slabs.push_back(std::move(slab));
  }
  return result;
}

FieldLevel decoded_level(const CompressedAttenuationField& field,
                         int level,
                         const FieldLevelMemory& memory) {
  check(!field.codebook.filter, "tiles without a filter");
  return decoded_slabs(
      field,
      level,
      memory,
      [&](std::size_t k, const FieldLevelSlab& slab, auto samples, int part, int parts) {
        const int u_tiles = field.lattice(k).u.stored.tiles();
        decode_slab(field, k, slab, level, share_of(u_tiles, part, parts), samples);
      });
}

/// Level 0 of a field whose codebook has a filter.
FieldLevel filtered_level_0(const CompressedAttenuationField& field,
                            const FieldLevelMemory& memory) {
  const FilteredDecoding decoding(field);
  return decoded_slabs(
      field,
      0,
      memory,
      [&](std::size_t k, const FieldLevelSlab& /*slab*/, auto samples, int part, int parts) {
        const Share rows = share_of(field.lattice(k).t.stored.tiles(), part, parts);
        decoding.decode(k, rows.begin, rows.end, samples);
      });
}

FieldLevelSlab halved_slab(const FieldLevelSlab& from,
                           const FieldLevel& level,
                           const FieldLevelMemory& memory) {
  FieldLevelSlab slab{halved_geometry(from.geometry), {}};
  slab.samples = padded_samples(level, slab, memory, [&](auto samples, int part, int parts) {
    const auto viewpoints = static_cast<int>(level.viewpoint_count());
    halve_slab(from, slab, share_of(viewpoints, part, parts), samples);
  });
  return slab;
}

FieldLevelSlab merged_slab(const LightSlab& field_geometry,
                           std::span<const FieldLevelSlab> from,
                           const FieldLevel& level,
                           const FieldLevelMemory& memory) {
  const SlabMerging merging(field_geometry, from);
  FieldLevelSlab slab{merging.geometry(), {}};
  slab.samples = padded_samples(level, slab, memory, [&](auto samples, int part, int parts) {
    const Share share = share_of(static_cast<int>(level.viewpoint_count()), part, parts);
    merging.merge(share.begin, share.end, samples);
  });
  return slab;
}

/// Up to coarsest_level, each from the one before.
void append_levels(int coarsest_level, const FieldLevelMemory& memory, FieldLevels& levels) {
  while (static_cast<int>(levels.size()) < coarsest_level)
    levels.push_back(std::make_shared<const FieldLevel>(next_field_level(*levels.back(), memory)));
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
  const auto viewpoint = static_cast<std::size_t>(node.u * field_geometry.v.nodes + node.v);
  const auto of_viewpoint =
      static_cast<std::size_t>(node.t - t.begin) * static_cast<std::size_t>(s.count) +
      static_cast<std::size_t>(node.s - s.begin);
  return quantizer_step *
         static_cast<float>(
             of_slab.samples[viewpoint * of_slab.samples_per_viewpoint() + of_viewpoint]);
}

double FieldLevel::blur_sigma_mm(bool with_resampling) const {
  return level_blur_sigma_in_nodes(level, with_resampling) * node_spacing_mm(field_geometry);
}

FieldLevelMemory process_memory(int threads) {
  check(threads >= 1, "at least one thread");
  return [threads](std::size_t count, const FieldLevelFill& fill) {
    const std::shared_ptr<std::uint16_t[]> owner =
        std::make_unique_for_overwrite<std::uint16_t[]>(count);
    const std::span<std::uint16_t> samples(owner.get(), count);
    ThreadPool pool(threads);
    pool.for_each(threads, [&](int part, int /*slot*/) { fill(samples, part, threads); });
    return SharedArray<std::uint16_t>(owner, samples);
  };
}

std::size_t decoded_bytes(const CompressedAttenuationField& field) {
  return static_cast<std::size_t>(field.lattice().tile_count()) * sizeof(Tile);
}

FieldLevel decode_field(const CompressedAttenuationField& field, const FieldLevelMemory& memory) {
  return field.codebook.filter ? filtered_level_0(field, memory) : decoded_level(field, 0, memory);
}

FieldLevel decode_halved_field(const CompressedAttenuationField& field,
                               const FieldLevelMemory& memory) {
  check(field.slabs.size() == 1, "several slabs are merged from their decoded samples");
  if (field.codebook.filter) return next_field_level(decode_field(field, memory), memory);
  return decoded_level(field, 1, memory);
}

FieldLevel next_field_level(const FieldLevel& level, const FieldLevelMemory& memory) {
  FieldLevel result{level.level + 1, level.field_geometry, level.quantizer_step, {}};
  const std::span slabs(level.slabs);
  // Level 1 keeps the slabs: with half the nodes they bear half the parallax, in nodes, and so do
  // the merged slabs of all further levels.
  if (result.level == 1) {
    for (const FieldLevelSlab& slab : slabs)
      result.slabs.push_back(halved_slab(slab, result, memory));
    return result;
  }
  for (std::size_t k = 0; k < slabs.size(); k += 2)
    result.slabs.push_back(
        k + 1 < slabs.size()
            ? merged_slab(level.field_geometry, slabs.subspan(k, 2), result, memory)
            : halved_slab(slabs[k], result, memory));
  return result;
}

FieldLevels make_field_pyramid(const CompressedAttenuationField& field,
                               int coarsest_level,
                               const FieldLevelMemory& memory) {
  if (field.slabs.size() > 1)
    return make_field_pyramid(decode_field(field, memory), coarsest_level, memory);
  check(coarsest_level >= 1, "a pyramid begins at level 1");
  FieldLevels levels{std::make_shared<const FieldLevel>(decode_halved_field(field, memory))};
  append_levels(coarsest_level, memory, levels);
  return levels;
}

FieldLevels make_field_pyramid(const FieldLevel& level_0,
                               int coarsest_level,
                               const FieldLevelMemory& memory) {
  check(coarsest_level >= 1, "a pyramid begins at level 1");
  FieldLevels levels{std::make_shared<const FieldLevel>(next_field_level(level_0, memory))};
  append_levels(coarsest_level, memory, levels);
  return levels;
}

}  // namespace af
