// SPDX-License-Identifier: Apache-2.0
#include "drr/viewpoint_blender.h"

#include <algorithm>

#include "base/vector_width.h"
#include "drr/blend_kernel.h"

namespace af {

namespace {

/// Taps for the (s or t) nodes of `nodes`: the ray from the source through node position p meets
/// the (u,v) plane at source + ratio * (p - source), on each axis by itself.
void make_taps(const GridAxis& node_axis,
               const NodeRange& nodes,
               double source_mm,
               double ratio,
               const GridAxis& viewpoint_axis,
               std::vector<ViewpointTap>& taps) {
  taps.clear();
  for (int node = nodes.begin; node < nodes.end(); ++node) {
    const double at_mm = source_mm + ratio * (node_axis.position_mm(node) - source_mm);
    // Nodes just outside the outermost rays can ask for a viewpoint just outside the rectangle.
    const double coordinate =
        std::clamp(viewpoint_axis.node_coordinate(at_mm), 0.0, viewpoint_axis.nodes - 1.0);
    const int lower = std::min(static_cast<int>(coordinate), viewpoint_axis.nodes - 2);
    taps.push_back({lower, static_cast<float>(coordinate - lower)});
  }
}

NodeRange overlap(const NodeRange& stored, int first, int last) {
  const int begin = std::max(first, stored.begin);
  return {begin, std::max(0, std::min(last + 1, stored.end()) - begin)};
}

/// What both kinds of field share: taps of the stored nodes, zeroes elsewhere.
class AnyBlender : public ViewpointBlender {
 public:
  void blend(std::size_t k,
             const SlabRays& rays,
             const Footprint& footprint,
             BlendScratch& scratch,
             std::span<float> blended) const final {
    const SlabGeometry& slab = lattice(k);
    const NodeRange s = overlap(slab.stored_s, footprint.s_first, footprint.s_last);
    const NodeRange t = overlap(slab.stored_t, footprint.t_first, footprint.t_last);
    if (s.count < footprint.s_count() || t.count < footprint.t_count())
      std::fill(blended.begin(), blended.end(), 0.0f);
    if (s.count == 0 || t.count == 0) return;
    const LightSlab& light_slab = coverage();
    const double ratio =
        (light_slab.uv_plane_y_mm - rays.source.y()) / (slab.st_plane_y_mm - rays.source.y());
    make_taps(slab.s, s, rays.source.x(), ratio, light_slab.u, scratch.u_taps);
    make_taps(slab.t, t, rays.source.z(), ratio, light_slab.v, scratch.v_taps);
    const std::ptrdiff_t stride = footprint.s_count();
    blend_stored(
        k,
        s,
        t,
        scratch,
        stride,
        blended.data() + (t.begin - footprint.t_first) * stride + (s.begin - footprint.s_first));
  }

 protected:
  /// The stored nodes s x t into `blended`, [t][s] with `stride` values from row to row.
  virtual void blend_stored(std::size_t k,
                            const NodeRange& s,
                            const NodeRange& t,
                            BlendScratch& scratch,
                            std::ptrdiff_t stride,
                            float* blended) const = 0;
};

class CompressedBlender final : public AnyBlender {
 public:
  explicit CompressedBlender(std::shared_ptr<const CompressedAttenuationField> field)
      : field_(std::move(field)) {}

  [[nodiscard]] const LightSlab& coverage() const override { return field_->light_slab; }
  [[nodiscard]] const SlabGeometry& lattice(std::size_t k) const override {
    return field_->light_slab.slabs[k];
  }

 private:
  void blend_stored(std::size_t k,
                    const NodeRange& s_nodes,
                    const NodeRange& t_nodes,
                    BlendScratch& scratch,
                    std::ptrdiff_t stride,
                    float* blended) const override {
    const SlabGeometry& slab = lattice(k);
    const auto t_tiles = static_cast<std::size_t>(slab.stored_t.tiles());
    const std::size_t v_stride = static_cast<std::size_t>(slab.stored_s.tiles()) * t_tiles;
    const std::size_t u_stride = v_stride * static_cast<std::size_t>(field_->tiles_v());
    for (int s = s_nodes.begin; s < s_nodes.end(); ++s) {
      const ViewpointTap& u = scratch.u_taps[static_cast<std::size_t>(s - s_nodes.begin)];
      const auto local_s = static_cast<std::size_t>(s - slab.stored_s.begin);
      for (int t = t_nodes.begin; t < t_nodes.end(); ++t) {
        const ViewpointTap& v = scratch.v_taps[static_cast<std::size_t>(t - t_nodes.begin)];
        const auto local_t = static_cast<std::size_t>(t - slab.stored_t.begin);
        const std::uint16_t* at =
            field_->slabs[k].indices.data() + (local_s / 2) * t_tiles + local_t / 2;
        const auto level = [&](int du, int dv) {
          const auto u_node = static_cast<std::size_t>(u.lower + du);
          const auto v_node = static_cast<std::size_t>(v.lower + dv);
          const Tile& tile =
              field_->codebook.codewords[at[u_node / 2 * u_stride + v_node / 2 * v_stride]];
          return static_cast<float>(
              tile[tile_element(u_node & 1u, v_node & 1u, local_s & 1u, local_t & 1u)]);
        };
        const float at_low_u = level(0, 0) + v.weight * (level(0, 1) - level(0, 0));
        const float at_up_u = level(1, 0) + v.weight * (level(1, 1) - level(1, 0));
        blended[(t - t_nodes.begin) * stride + (s - s_nodes.begin)] =
            field_->quantizer_step * (at_low_u + u.weight * (at_up_u - at_low_u));
      }
    }
  }

  std::shared_ptr<const CompressedAttenuationField> field_;
};

class LevelBlender final : public AnyBlender {
 public:
  explicit LevelBlender(std::shared_ptr<const FieldLevel> level) : level_(std::move(level)) {}

  [[nodiscard]] const LightSlab& coverage() const override { return level_->coverage; }
  [[nodiscard]] const SlabGeometry& lattice(std::size_t k) const override {
    return level_->slabs[k].lattice;
  }

 private:
  void blend_stored(std::size_t k,
                    const NodeRange& s,
                    const NodeRange& t,
                    BlendScratch& scratch,
                    std::ptrdiff_t stride,
                    float* blended) const override {
    const FieldLevelSlab& slab = level_->slabs[k];
    const auto blend_samples = select_kernel<BlendSamples>(
        kernels_128::blend_samples, kernels_256::blend_samples, kernels_512::blend_samples);
    scratch.u_weights.clear();
    for (const ViewpointTap& tap : scratch.u_taps) scratch.u_weights.push_back(tap.weight);
    const auto v_stride = static_cast<std::ptrdiff_t>(slab.samples_per_viewpoint());
    const std::ptrdiff_t u_stride = v_stride * level_->coverage.v.nodes;
    for (int row = 0; row < t.count; ++row) {
      const ViewpointTap& v = scratch.v_taps[static_cast<std::size_t>(row)];
      const std::ptrdiff_t in_viewpoint =
          static_cast<std::ptrdiff_t>(t.begin + row - slab.lattice.stored_t.begin) *
              slab.lattice.stored_s.count +
          (s.begin - slab.lattice.stored_s.begin);
      // Runs of nodes that lie between the same viewpoints.
      for (int begin = 0, end = 0; begin < s.count; begin = end) {
        const int lower = scratch.u_taps[static_cast<std::size_t>(begin)].lower;
        while (end < s.count && scratch.u_taps[static_cast<std::size_t>(end)].lower == lower) ++end;
        const std::uint16_t* samples =
            slab.samples.data() + lower * u_stride + v.lower * v_stride + in_viewpoint + begin;
        blend_samples(
            {{samples, samples + v_stride, samples + u_stride, samples + u_stride + v_stride},
             scratch.u_weights.data() + begin,
             v.weight,
             level_->quantizer_step},
            blended + row * stride + begin,
            end - begin);
      }
    }
  }

  std::shared_ptr<const FieldLevel> level_;
};

}  // namespace

std::unique_ptr<const ViewpointBlender> make_viewpoint_blender(
    std::shared_ptr<const CompressedAttenuationField> field) {
  return std::make_unique<CompressedBlender>(std::move(field));
}

std::unique_ptr<const ViewpointBlender> make_viewpoint_blender(
    std::shared_ptr<const FieldLevel> level) {
  return std::make_unique<LevelBlender>(std::move(level));
}

}  // namespace af
