// SPDX-License-Identifier: Apache-2.0
#include "drr/viewpoint_blender.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.h"
#include "base/vector_width.h"

namespace af {

namespace {

/// Cubic weights, or their slopes, of nodes -1, 0, 1, 2 for a position between nodes 0 and 1.
using CubicTaps = std::array<double, 4>;

CubicTaps cubic_weights(double x) {
  return {0.5 * x * (x * (2.0 - x) - 1.0),
          0.5 * (x * x * (3.0 * x - 5.0) + 2.0),
          0.5 * x * (x * (4.0 - 3.0 * x) + 1.0),
          0.5 * x * x * (x - 1.0)};
}

CubicTaps cubic_slopes(double x) {
  return {0.5 * (x * (4.0 - 3.0 * x) - 1.0),
          0.5 * x * (9.0 * x - 10.0),
          0.5 * (x * (8.0 - 9.0 * x) + 1.0),
          0.5 * x * (3.0 * x - 2.0)};
}

/// Moves the taps inside: the weight of a node beyond the first or last one goes to the nodes that
/// it continues linearly. Needs at least four nodes.
CubicTaps folded(const CubicTaps& taps, int lower, int nodes) {
  if (lower == 0) return {taps[1] + 2.0 * taps[0], taps[2] - taps[0], taps[3], 0.0};
  if (lower == nodes - 2) return {0.0, taps[0], taps[1] - taps[3], taps[2] + 2.0 * taps[3]};
  return taps;
}

/// How the viewpoint coordinate on one axis follows from the node. The ray from the source through
/// node position p meets the (u,v) plane at source + ratio * (p - source), on each axis separately.
class ViewpointLine {
 public:
  ViewpointLine(const GridAxis& nodes,
                double source_mm,
                double ratio,
                const GridAxis& viewpoints,
                AxisInterpolation interpolation)
      : at_node_0_(viewpoints.node_coordinate(source_mm + ratio * (nodes.first_mm - source_mm))),
        per_node_(ratio * nodes.spacing_mm() / viewpoints.spacing_mm()),
        per_mm_((1.0 - ratio) / viewpoints.spacing_mm()),
        viewpoints_(viewpoints.nodes),
        interpolation_(interpolation) {}

  [[nodiscard]] ViewpointTap tap(int node) const {
    // Nodes just outside the outermost rays can ask for a viewpoint just outside the rectangle.
    // This order turns NaN into 0: the difference of two sums beyond a double's range is no number.
    const double coordinate =
        std::min(std::max(0.0, at_node_0_ + node * per_node_), viewpoints_ - 1.0);
    const int lower = std::min(static_cast<int>(coordinate), viewpoints_ - 2);
    const double x = coordinate - lower;
    const auto slope = static_cast<float>(per_mm_);
    if (interpolation_ == AxisInterpolation::Linear)
      return {lower,
              {static_cast<float>(1.0 - x), static_cast<float>(x), 0.0f, 0.0f},
              {-slope, slope, 0.0f, 0.0f}};
    const CubicTaps weights = folded(cubic_weights(x), lower, viewpoints_);
    const CubicTaps slopes = folded(cubic_slopes(x), lower, viewpoints_);
    ViewpointTap tap{std::clamp(lower - 1, 0, viewpoints_ - 4), {}, {}};
    for (std::size_t i = 0; i < 4; ++i) {
      tap.weights[i] = static_cast<float>(weights[i]);
      tap.slopes[i] = static_cast<float>(per_mm_ * slopes[i]);
    }
    return tap;
  }

  void make_taps(const NodeRange& nodes, std::vector<ViewpointTap>& taps) const {
    taps.clear();
    for (int node = nodes.begin; node < nodes.end(); ++node) taps.push_back(tap(node));
  }

 private:
  double at_node_0_;
  double per_node_;
  double per_mm_;
  int viewpoints_;
  AxisInterpolation interpolation_;
};

NodeRange overlap(const NodeRange& a, const NodeRange& b) {
  const int begin = std::max(a.begin, b.begin);
  return {begin, std::max(0, std::min(a.end(), b.end()) - begin)};
}

/// A rectangle of nodes, such as those of an image that a blender fills.
struct NodeRectangle {
  NodeRange s;
  NodeRange t;
};

/// Zeroes the nodes of the footprint's box that are not stored.
void clear_unstored(const Footprint& footprint,
                    const NodeRectangle& stored,
                    float* image,
                    std::ptrdiff_t stride) {
  const int s_count = footprint.s().count;
  const int left = stored.s.begin - footprint.s().begin;
  const int right = left + stored.s.count;
  for (int t = footprint.t().begin; t < footprint.t().end(); ++t, image += stride) {
    if (t < stored.t.begin || t >= stored.t.end() || stored.s.count == 0) {
      std::fill_n(image, s_count, 0.0f);
      continue;
    }
    std::fill_n(image, left, 0.0f);
    std::fill(image + right, image + s_count, 0.0f);
  }
}

/// What both kinds of field share: taps for the stored nodes, zeroes elsewhere.
class AnyBlender : public ViewpointBlender {
 public:
  explicit AnyBlender(AxisInterpolation uv) : uv_(uv) {}

  void blend(std::size_t k,
             const SlabRays& rays,
             const Footprint& footprint,
             BlendScratch& scratch,
             const BlendedImages& images) const final {
    const SlabGeometry& slab = this->slab(k);
    const NodeRectangle stored = stored_nodes(slab, footprint);
    if (stored.s.count > 0 && stored.t.count > 0) {
      const double ratio = (field_geometry().uv_plane_y_mm - rays.source.y()) /
                           (slab.st_plane_y_mm - rays.source.y());
      ViewpointLine(slab.s, rays.source.x(), ratio, field_geometry().u, interpolation())
          .make_taps(stored.s, scratch.u_taps);
      ViewpointLine(slab.t, rays.source.z(), ratio, field_geometry().v, interpolation())
          .make_taps(stored.t, scratch.v_taps);
      blend_stored(k, footprint, stored, scratch, images);
    }
    if (stored.s.count == footprint.s().count && stored.t.count == footprint.t().count) return;
    for (float* image : {images.value, images.source_x, images.source_z})
      if (image != nullptr) clear_unstored(footprint, stored, image, images.stride);
  }

 protected:
  /// The nodes that the footprint and the field share.
  [[nodiscard]] virtual NodeRectangle stored_nodes(const SlabGeometry& slab,
                                                   const Footprint& footprint) const = 0;
  virtual void blend_stored(std::size_t k,
                            const Footprint& footprint,
                            const NodeRectangle& stored,
                            BlendScratch& scratch,
                            const BlendedImages& images) const = 0;

  [[nodiscard]] AxisInterpolation interpolation() const {
    const bool has_four = field_geometry().u.nodes >= 4 && field_geometry().v.nodes >= 4;
    return has_four ? uv_ : AxisInterpolation::Linear;
  }
  [[nodiscard]] int tap_count() const {
    return interpolation() == AxisInterpolation::Linear ? 2 : 4;
  }

 private:
  AxisInterpolation uv_;
};

/// Where the image values of a node are.
BlendedImages at_node(const BlendedImages& images, const Footprint& footprint, int s, int t) {
  const std::ptrdiff_t offset =
      (t - footprint.t().begin) * images.stride + (s - footprint.s().begin);
  if (images.source_x == nullptr) return {images.value + offset, nullptr, nullptr, images.stride};
  return {images.value + offset, images.source_x + offset, images.source_z + offset, images.stride};
}

/// A codeword aligned to half a cache line.
struct alignas(32) AlignedTile {
  Tile elements;
};
/// The same for a shape, the differences from the mean.
struct alignas(32) AlignedShape {
  std::array<std::int16_t, kTileElements> differences;
};

AlignedShape aligned_shape(const Tile& codeword) {
  AlignedShape shape{};
  for (std::size_t i = 0; i < kTileElements; ++i)
    shape.differences[i] = static_cast<std::int16_t>(int{codeword[i]} - kShapeZero);
  return shape;
}

class CompressedBlender final : public AnyBlender {
 public:
  CompressedBlender(std::shared_ptr<const CompressedAttenuationField> field, AxisInterpolation uv)
      : AnyBlender(uv), field_(std::move(field)) {
    const Codebook& codebook = field_->codebook;
    check(!codebook.filter, "tiles without a filter");
    if (codebook.has_means()) {
      shapes_.reserve(codebook.size());
      for (const Tile& tile : codebook.codewords) shapes_.push_back(aligned_shape(tile));
    } else {
      codewords_.reserve(codebook.size());
      for (const Tile& tile : codebook.codewords) codewords_.push_back({tile});
    }
  }

  [[nodiscard]] const LightSlab& field_geometry() const override { return field_->light_slab; }
  [[nodiscard]] std::size_t slab_count() const override { return field_->slabs.size(); }
  [[nodiscard]] const SlabGeometry& slab(std::size_t k) const override {
    return field_->light_slab.slabs[k];
  }
  [[nodiscard]] Footprint footprint(std::size_t k,
                                    const SlabRays& rays,
                                    int margin) const override {
    return {slab(k), rays, {margin, true}};
  }

 private:
  [[nodiscard]] NodeRectangle stored_nodes(const SlabGeometry& slab,
                                           const Footprint& footprint) const override {
    const NodeRange s{slab.stored_s.begin, 2 * slab.stored_s.tiles()};
    const NodeRange t{slab.stored_t.begin, 2 * slab.stored_t.tiles()};
    return {overlap(s, footprint.s()), overlap(t, footprint.t())};
  }

  /// One of the axis pairs u, s and v, t of a tile.
  struct TileAxis {
    std::int64_t tile_stride;  ///< between the viewpoints' tiles in the index array
    unsigned node_bit;         ///< bit of an element's number; the viewpoint's bit is two higher
    float scale;               ///< factor of all weights
  };

  /// Regroups the taps of node pairs by the pairs of viewpoints that share a tile.
  void make_tile_taps(const std::vector<ViewpointTap>& node_taps,
                      const TileAxis& axis,
                      std::vector<TileTap>& taps,
                      std::vector<std::int32_t>& begin) const {
    taps.clear();
    begin.assign(1, 0);
    for (std::size_t i = 0; i < node_taps.size(); i += 2) {
      const ViewpointTap* pair = node_taps.data() + i;
      const int first = std::min(pair[0].first, pair[1].first) / 2;
      const int last = (std::max(pair[0].first, pair[1].first) + tap_count() - 1) / 2;
      for (int tile = first; tile <= last; ++tile) append_tile_tap(pair, tile, axis, taps);
      begin.push_back(static_cast<std::int32_t>(taps.size()));
    }
  }

  /// The contribution of viewpoints 2 tile and 2 tile + 1 to a pair of nodes, unless it is zero.
  void append_tile_tap(const ViewpointTap* pair,
                       int tile,
                       const TileAxis& axis,
                       std::vector<TileTap>& taps) const {
    float weights[4] = {};  // [viewpoint][node]
    float slopes[4] = {};
    bool is_used = false;
    for (int i = 0; i < 4; ++i) {
      const ViewpointTap& node = pair[i % 2];
      const int at = 2 * tile + i / 2 - node.first;
      if (at < 0 || at >= tap_count()) continue;
      weights[i] = axis.scale * node.weights[at];
      slopes[i] = axis.scale * node.slopes[at];
      is_used = is_used || weights[i] != 0.0f || slopes[i] != 0.0f;
    }
    if (!is_used) return;
    TileTap& tap = taps.emplace_back();
    tap.offset = tile * axis.tile_stride;
    if (axis.node_bit == 0) {
      spread<0>(weights, tap.weights);
      spread<0>(slopes, tap.slopes);
    } else {
      spread<1>(weights, tap.weights);
      spread<1>(slopes, tap.slopes);
    }
  }

  /// Spreads values [viewpoint][node] over the elements of a codeword.
  template <unsigned kNodeBit>
  static void spread(const float (&values)[4], float (&elements)[kTileElements]) {
    for (unsigned element = 0; element < kTileElements; ++element)
      elements[element] = values[(element >> (2 + kNodeBit) & 1u) * 2 + (element >> kNodeBit & 1u)];
  }

  void blend_stored(std::size_t k,
                    const Footprint& footprint,
                    const NodeRectangle& stored,
                    BlendScratch& scratch,
                    const BlendedImages& images) const override {
    const SlabGeometry& slab = this->slab(k);
    const std::int64_t t_tiles = slab.stored_t.tiles();
    const bool has_means = field_->codebook.has_means();
    const std::int64_t row = has_means ? 2 * t_tiles : t_tiles;
    const std::int64_t v_stride = slab.stored_s.tiles() * row;
    const std::int64_t u_stride = v_stride * field_->lattice(k).v.stored.tiles();
    const auto blend_tiles = select_kernel<BlendTiles>(
        kernels_128::blend_tiles, kernels_256::blend_tiles, kernels_512::blend_tiles);
    make_tile_taps(
        scratch.u_taps, {u_stride, 1, field_->quantizer_step}, scratch.u_tiles, scratch.u_begin);
    make_tile_taps(scratch.v_taps, {v_stride, 0, 1.0f}, scratch.v_tiles, scratch.v_begin);
    const int t_tile = (stored.t.begin - slab.stored_t.begin) / 2;
    for (int c = 0; c < stored.s.count / 2; ++c) {
      const int s = stored.s.begin + 2 * c;
      const NodeRange needed = overlap(footprint.t_needed({s, 2}), stored.t);
      if (needed.count == 0) continue;
      const BlendedImages strip = at_node(images, footprint, s, stored.t.begin);
      const auto at = static_cast<std::size_t>(c);
      blend_tiles({field_->slabs[k].indices.data() + ((s - slab.stored_s.begin) / 2) * row + t_tile,
                   has_means ? nullptr : codewords_.front().elements.data(),
                   has_means ? shapes_.front().differences.data() : nullptr,
                   t_tiles,
                   scratch.u_tiles.data() + scratch.u_begin[at],
                   scratch.u_begin[at + 1] - scratch.u_begin[at],
                   scratch.v_tiles.data(),
                   scratch.v_begin.data(),
                   (needed.begin - stored.t.begin) / 2,
                   (needed.end() - stored.t.begin + 1) / 2,
                   {strip.value, strip.source_x, strip.source_z},
                   images.stride});
    }
  }

  std::shared_ptr<const CompressedAttenuationField> field_;
  std::vector<AlignedTile> codewords_;
  std::vector<AlignedShape> shapes_;  ///< instead, where tiles have means
};

class LevelBlender final : public AnyBlender {
 public:
  LevelBlender(std::shared_ptr<const FieldLevel> level, AxisInterpolation uv)
      : AnyBlender(uv), level_(std::move(level)) {
    for (const FieldLevelSlab& slab : level_->slabs)
      check(slab.samples.size() ==
                level_->viewpoint_count() * slab.samples_per_viewpoint() + kFieldLevelPadding,
            "a field level's samples do not have its geometry's size");
  }

  [[nodiscard]] const LightSlab& field_geometry() const override { return level_->field_geometry; }
  [[nodiscard]] std::size_t slab_count() const override { return level_->slabs.size(); }
  [[nodiscard]] const SlabGeometry& slab(std::size_t k) const override {
    return level_->slabs[k].geometry;
  }
  [[nodiscard]] Footprint footprint(std::size_t k,
                                    const SlabRays& rays,
                                    int margin) const override {
    return {slab(k), rays, {margin, false}};
  }

 private:
  [[nodiscard]] NodeRectangle stored_nodes(const SlabGeometry& slab,
                                           const Footprint& footprint) const override {
    return {overlap(slab.stored_s, footprint.s()), overlap(slab.stored_t, footprint.t())};
  }

  void blend_stored(std::size_t k,
                    const Footprint& footprint,
                    const NodeRectangle& stored,
                    BlendScratch& scratch,
                    const BlendedImages& images) const override {
    const FieldLevelSlab& slab = level_->slabs[k];
    const auto blend_samples = select_kernel<BlendSamples>(
        kernels_128::blend_samples, kernels_256::blend_samples, kernels_512::blend_samples);
    make_u_weights(scratch);
    const auto viewpoint_of = [](const std::vector<ViewpointTap>& taps, int node) {
      return taps[static_cast<std::size_t>(node)].first;
    };
    // Blocks of nodes that lie between the same viewpoints. Those of a row go from left to right,
    // because each writes beyond its right edge.
    const NodeRange &s = stored.s, &t = stored.t;
    for (int t_begin = t.begin, t_end = t_begin; t_begin < t.end(); t_begin = t_end) {
      const int v = viewpoint_of(scratch.v_taps, t_begin - t.begin);
      while (t_end < t.end() && viewpoint_of(scratch.v_taps, t_end - t.begin) == v) ++t_end;
      const NodeRange rows{t_begin, t_end - t_begin};
      const NodeRange needed = overlap(footprint.s_needed(rows), s);
      for (int begin = needed.begin, end = begin; begin < needed.end(); begin = end) {
        const int u = viewpoint_of(scratch.u_taps, begin - s.begin);
        while (end < needed.end() && viewpoint_of(scratch.u_taps, end - s.begin) == u) ++end;
        blend_samples(block_of(slab,
                               scratch,
                               stored,
                               {{begin, end - begin}, rows},
                               at_node(images, footprint, begin, t_begin)));
      }
    }
  }

  /// How many weights one tap has: one per node, readable for a vector beyond their end.
  static std::size_t weight_count(const BlendScratch& scratch) {
    return scratch.u_taps.size() + kFieldLevelPadding;
  }

  /// One row of weights and one of slopes per tap.
  void make_u_weights(BlendScratch& scratch) const {
    const std::size_t row_length = weight_count(scratch);
    const auto taps = static_cast<std::size_t>(tap_count());
    scratch.u_weights.resize(2 * taps * row_length);
    for (std::size_t i = 0; i < scratch.u_taps.size(); ++i)
      for (std::size_t tap = 0; tap < taps; ++tap) {
        float* weight = scratch.u_weights.data() + 2 * tap * row_length + i;
        weight[0] = level_->quantizer_step * scratch.u_taps[i].weights[tap];
        weight[row_length] = level_->quantizer_step * scratch.u_taps[i].slopes[tap];
      }
  }

  [[nodiscard]] SampleBlock block_of(const FieldLevelSlab& slab,
                                     const BlendScratch& scratch,
                                     const NodeRectangle& stored,
                                     const NodeRectangle& nodes,
                                     const BlendedImages& images) const {
    const auto first_s = static_cast<std::size_t>(nodes.s.begin - stored.s.begin);
    const auto first_t = static_cast<std::size_t>(nodes.t.begin - stored.t.begin);
    const SlabGeometry& geometry = slab.geometry;
    SampleBlock block{};
    block.t_stride = geometry.stored_s.count;
    block.v_stride = static_cast<std::int64_t>(slab.samples_per_viewpoint());
    block.u_stride = block.v_stride * level_->field_geometry.v.nodes;
    block.taps = tap_count();
    block.samples =
        slab.samples.viewpoints(
            scratch.u_taps[first_s].first, scratch.v_taps[first_t].first, block.taps, block.taps) +
        (nodes.t.begin - geometry.stored_t.begin) * block.t_stride +
        (nodes.s.begin - geometry.stored_s.begin);
    const std::size_t row_length = weight_count(scratch);
    for (std::size_t tap = 0; tap < static_cast<std::size_t>(block.taps); ++tap) {
      block.u_weights[tap] = scratch.u_weights.data() + 2 * tap * row_length + first_s;
      block.u_slopes[tap] = block.u_weights[tap] + row_length;
    }
    block.v_taps = scratch.v_taps.data() + first_t;
    block.images[0] = images.value;
    block.images[1] = images.source_x;
    block.images[2] = images.source_z;
    block.image_stride = images.stride;
    block.columns = nodes.s.count;
    block.rows = nodes.t.count;
    return block;
  }

  std::shared_ptr<const FieldLevel> level_;
};

}  // namespace

std::unique_ptr<const ViewpointBlender> make_viewpoint_blender(
    std::shared_ptr<const CompressedAttenuationField> field, AxisInterpolation uv) {
  if (field->codebook.filter)
    return std::make_unique<LevelBlender>(std::make_shared<const FieldLevel>(decode_field(field)),
                                          uv);
  return std::make_unique<CompressedBlender>(std::move(field), uv);
}

std::unique_ptr<const ViewpointBlender> make_viewpoint_blender(
    std::shared_ptr<const FieldLevel> level, AxisInterpolation uv) {
  return std::make_unique<LevelBlender>(std::move(level), uv);
}

}  // namespace af
