// SPDX-License-Identifier: Apache-2.0
// A field with its planes, made step by step from its parts, and the memory that making it takes.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "precompute/build/memory_plan.h"
#include "precompute/build/precompute_options.h"
#include "precompute/casting/unit_planner.h"
#include "precompute/design_choice.h"
#include "precompute/field_parts.h"
#include "precompute/precompute_run.h"

namespace af {

/// Everything on which a field's samples depend.
struct SizedField {
  PrecomputeOptions options;           ///< with the chosen design and nodes
  std::optional<DesignChoice> choice;  ///< where a probe chose the design
  FieldSource source;
  std::vector<FieldPart> parts;              ///< one, or the members of an atlas
  FieldLattice lattice = lattice_of(parts);  ///< of all parts

  /// Bytes of the CT and its resampled grid, once per node.
  [[nodiscard]] std::uint64_t volume_bytes() const;
  /// The size of units that suits the caster and this many ranks.
  [[nodiscard]] PlanOptions unit_plan(int ranks) const;
};

/// The planes of the options' field, for a motion range of `range`. Throws as make_light_slab()
/// does.
LightSlab sized_planes(const FieldSource& source,
                       const PrecomputeOptions& options,
                       const MotionRange& range,
                       const DepthSlabs& depth_slabs);

/// Collective. Every part with the planes that its depth slabs take. Throws as make_light_slab()
/// does.
std::vector<FieldPart> with_planes(std::vector<FieldPart> parts,
                                   const PrecomputeOptions& options,
                                   const Communicator& communicator);

/// Whether the caster, a probe or the cut into slabs reads the resampled CT.
bool needs_resampled_ct(const PrecomputeOptions& options);

/// Collective. Every part cut into the depth slabs of the options' design, with planes for them.
/// The resampled CT is released where the caster does not need it. Throws as choose_depth_slabs()
/// does.
std::vector<FieldPart> cut_into_slabs(std::vector<FieldPart> parts,
                                      const PrecomputeOptions& options,
                                      const Communicator& communicator);

/// Collective. Where the options state a spacing, gives the (s,t) planes the fewest nodes that are
/// no farther apart than that on any plane. The number is a multiple of 32, so that levels of the
/// pyramid halve it evenly. Otherwise the field is returned as it is. Throws InputError beyond
/// kMostPlaneNodes.
SizedField with_nodes_of_spacing(SizedField field, const Communicator& communicator);

/// Collective. The memory of a rank in each phase. What it takes now counts as fixed.
MemoryPlan memory_plan(const SizedField& field,
                       const std::vector<WorkUnit>& units,
                       const PrecomputeRun& run);

/// Collective. Peak memory since forget_peak(), besides the CT and its grid, of the rank that had
/// most.
std::uint64_t peak_bytes_of_a_rank(const SizedField& field, const PrecomputeRun& run);

}  // namespace af
