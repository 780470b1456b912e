// SPDX-License-Identifier: Apache-2.0
// The fields that af-precompute makes: one field or the members of an atlas, each with its planes,
// and one caster for all.
#pragma once

#include <memory>
#include <vector>

#include "field/attenuation_quantizer.h"
#include "geometry/field_lattice.h"
#include "geometry/light_slab.h"
#include "precompute/casting/depth_slabs.h"
#include "precompute/casting/field_caster.h"
#include "precompute/casting/slab_aligned_volume.h"
#include "precompute/casting/work_unit.h"
#include "precompute/field_source.h"
#include "ranks/communicator.h"

namespace af {

/// One field to make.
struct FieldPart {
  FieldSource source;  ///< with its own camera, and the range and sources that it is sized for
  MotionRange range;   ///< about the nominal pose; the field holds all of it
  LightSlab light_slab;
  std::shared_ptr<const SlabAlignedVolume> resampled;  ///< for casters that need it
};

/// Collective. The field of the options, or the members of their atlas; without planes. The same on
/// every rank. InputError when the orbit or the list of cameras makes no atlas.
std::vector<FieldPart> field_parts(const FieldSource& source,
                                   const PrecomputeOptions& options,
                                   const Communicator& communicator);

/// The planes of the options' field, for a motion range of `range`. Errors of make_light_slab().
LightSlab sized_planes(const FieldSource& source,
                       const PrecomputeOptions& options,
                       const MotionRange& range,
                       const DepthSlabs& depth_slabs);

/// The nodes of the parts' (s,t) planes where they stand at most `spacing_mm` apart on every one of
/// them; otherwise the fewest that do, a multiple of 32, so that levels of the pyramid halve them
/// evenly. InputError beyond kMostPlaneNodes.
int st_nodes_at_most_apart(const std::vector<FieldPart>& parts, double spacing_mm);

/// The slabs of all parts, those of the first part first.
FieldLattice lattice_of(const std::vector<FieldPart>& parts);

/// A caster of all slabs. The parts must outlive it.
std::unique_ptr<const FieldCaster> make_caster(const std::vector<FieldPart>& parts,
                                               const PrecomputeOptions& options,
                                               const AttenuationQuantizer& quantizer);

/// unit_costs() of units of all slabs.
std::vector<double> costs_over_parts(const std::vector<WorkUnit>& units,
                                     const std::vector<FieldPart>& parts);

}  // namespace af
