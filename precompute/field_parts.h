// SPDX-License-Identifier: Apache-2.0
// The fields that af-precompute makes: one field or the members of an atlas. Each has its planes
// and the CT along their axes. One caster serves all.
#pragma once

#include <memory>
#include <vector>

#include "geometry/field_lattice.h"
#include "geometry/light_slab.h"
#include "precompute/casting/depth_slabs.h"
#include "precompute/casting/field_caster.h"
#include "precompute/casting/slab_aligned_volume.h"
#include "precompute/casting/work_unit.h"
#include "precompute/field_source.h"
#include "ranks/communicator.h"
#include "ranks/work_watch.h"

namespace af {

/// One field to make.
struct FieldPart {
  FieldSource source;  ///< with its own camera, and the range and sources that it is sized for
  MotionRange range;   ///< about the nominal pose; the field holds all of it
  LightSlab light_slab;
  std::shared_ptr<const SlabAlignedVolume> resampled;  ///< for casters that need it
  DepthSlabs depth_slabs = {{}, {0.0}};                ///< at first one, through the centre
};

/// Collective. The field of the options, or the members of their atlas, without planes. The same on
/// every rank. Throws InputError when the orbit or the list of cameras makes no atlas.
std::vector<FieldPart> field_parts(const FieldSource& source,
                                   const PrecomputeOptions& options,
                                   const Communicator& communicator);

/// Collective. Every part, whose planes are known, with the CT in its slab frame, held once per
/// node. The ranks of a node share the work.
std::vector<FieldPart> with_resampled_ct(std::vector<FieldPart> parts,
                                         WorkNote& note,
                                         const Communicator& communicator);

/// The slabs of all parts, those of the first part first.
FieldLattice lattice_of(const std::vector<FieldPart>& parts);

/// A caster of all slabs. The parts must outlive it.
std::unique_ptr<const FieldCaster> make_caster(const std::vector<FieldPart>& parts,
                                               const PrecomputeOptions& options);

/// unit_costs() for units of all slabs.
std::vector<double> costs_over_parts(const std::vector<WorkUnit>& units,
                                     const std::vector<FieldPart>& parts);

}  // namespace af
