// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "drr/level_samples.h"
#include "field/compressed_attenuation_field.h"

namespace af {

/// Mean distance (mm) between a field's (s,t) nodes at the plane through the field's centre (y = 0
/// of the slab frame), averaged over s, t and the slabs.
double node_spacing_mm(const LightSlab& light_slab);

/// How often a field's (s,t) axes are halved before the first level of its pyramid. Halving goes on
/// until the longest axis has about 256 nodes, the paper's number, but only while nodes stand no
/// farther apart than the paper's, about 1.1 mm (10 degrees and 30 mm in the treatment room). The
/// second condition is for fields that have more nodes because their range is wider. Halved by node
/// count alone, levels of 20 degrees and 40 mm had twice the blur, at which scatter and steel
/// create optima of their own. \test FieldLevel.BeginsWithMoreHalvingsOfFinerNodesNotOfAWiderRange
int halvings_to_usual_nodes(const LightSlab& light_slab);

/// One slab of a field held as plain 16-bit samples, [u][v][t][s] with s fastest. s runs along the
/// detector's columns, so a row of viewpoint samples is a row of a DRR.
struct FieldLevelSlab {
  SlabGeometry geometry;  ///< this level's (s,t) nodes; stored ranges need not be even
  LevelSamples samples;
  /// The sum of the slab's levels as its codewords have them. Slabs are merged by this weight.
  double weight = 0.0;

  [[nodiscard]] std::size_t samples_per_viewpoint() const {
    return static_cast<std::size_t>(geometry.stored_s.count) *
           static_cast<std::size_t>(geometry.stored_t.count);
  }
};

/// Standard deviation, in nodes of level 0, of the blur along s and t of a DRR of this level
/// compared with one of level 0. The halvings i = 0 ... level - 1 add variances of 3/4 4^i.
/// Bilinear resampling of the coarser nodes blurs a little more, on average by a variance of
/// (4^level - 1) / 6 nodes of level 0; `with_resampling` includes it.
double level_blur_sigma_in_nodes(int level, bool with_resampling = false);

/// A decoded attenuation field, blurred and decimated in (s,t) for one level of an image pyramid.
///
/// Level 0 has the field's own samples. Each further level halves the nodes of both (s,t) axes. A
/// node lies midway between nodes 2i and 2i + 1 of the level below and takes (1 3 3 1)/8 of nodes
/// 2i - 1 ... 2i + 2 along each axis, rounded to 16 bits. Beyond the lattice the outermost nodes
/// are replicated; nodes that are not stored count as 0. (u,v) nodes stay. Memory: 2 bytes per
/// sample, 134 MB for level 1 and 34 MB for level 2 of 64x64 x 256x256 nodes (uncropped). \test
/// FieldLevel.HalvingTakesBinomialWeights
///
/// If the field has several slabs, each level above 1 merges neighbours into half as many
/// (SlabMerging). An odd one out is only halved.
struct FieldLevel {
  int level = 0;
  LightSlab
      field_geometry;  ///< the field's geometry: it decides which rays are outside, at every level
  float quantizer_step = 0.0f;
  std::vector<FieldLevelSlab> slabs;  ///< ascending in depth, as field_geometry.slabs

  [[nodiscard]] std::size_t viewpoint_count() const {
    return static_cast<std::size_t>(field_geometry.u.nodes) *
           static_cast<std::size_t>(field_geometry.v.nodes);
  }

  /// Total attenuation at a node of one of this level's slabs; 0 where nothing is stored.
  [[nodiscard]] float node_value(std::size_t slab, const NodeIndex& node) const;

  /// level_blur_sigma_in_nodes() in mm at the plane through the field's centre (y = 0 of the slab
  /// frame), averaged over s, t and the slabs. To match, blur a reference image by this sigma times
  /// the magnification there.
  [[nodiscard]] double blur_sigma_mm(bool with_resampling = false) const;
};

/// Memory that a field's level 0 takes.
std::size_t decoded_bytes(const CompressedAttenuationField& field);

/// Level 0 of a compressed field. It is made where it is looked at: at most 537 MB for 64x64 x
/// 256x256 nodes, or 67 MB for 8x8 x 256x256 in two slabs.
FieldLevel decode_field(const std::shared_ptr<const CompressedAttenuationField>& field,
                        const FieldLevelMemory& memory = process_memory());

/// Level 1 of a compressed field of one slab. Its level 0 is made only when the codebook has a
/// filter, then in memory of this process. Throws InputError when an axis has too few nodes to
/// halve.
FieldLevel decode_halved_field(const std::shared_ptr<const CompressedAttenuationField>& field,
                               const FieldLevelMemory& memory = process_memory());

/// The level above. Throws InputError when an axis has too few nodes to halve.
FieldLevel next_field_level(const std::shared_ptr<const FieldLevel>& level,
                            const FieldLevelMemory& memory = process_memory());

using FieldLevels = std::vector<std::shared_ptr<const FieldLevel>>;

/// Levels 1 ... coarsest_level of a compressed field; [0] is level 1, and coarsest_level >= 1.
/// Memory of this process holds the level 0 of several slabs, and levels 1 ... stepping_stones,
/// which serve to make those above.
FieldLevels make_field_pyramid(const std::shared_ptr<const CompressedAttenuationField>& field,
                               int coarsest_level,
                               const FieldLevelMemory& memory = process_memory(),
                               int stepping_stones = 0);
/// The same from the level 0 of a field.
FieldLevels make_field_pyramid(const std::shared_ptr<const FieldLevel>& level_0,
                               int coarsest_level,
                               const FieldLevelMemory& memory = process_memory(),
                               int stepping_stones = 0);

/// An axis with half the nodes, midway between pairs of the given ones. Throws InputError, which
/// names the axis, when there are too few.
GridAxis halved_axis(const GridAxis& axis, const char* name);

}  // namespace af
