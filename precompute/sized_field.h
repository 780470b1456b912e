// SPDX-License-Identifier: Apache-2.0
// A field with its planes, link by link from its parts, and the memory that making it takes.
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

/// All that a field's samples depend on.
struct SizedField {
  PrecomputeOptions options;           ///< with the design and the nodes that were chosen
  std::optional<DesignChoice> choice;  ///< where a probe chose the design
  FieldSource source;
  std::vector<FieldPart> parts;              ///< one, or the members of an atlas
  FieldLattice lattice = lattice_of(parts);  ///< of all of them

  /// Of the CT and its resampled grid, once per node.
  [[nodiscard]] std::uint64_t volume_bytes() const;
  /// The size of units that suits the caster and so many ranks.
  [[nodiscard]] PlanOptions unit_plan(int ranks) const;
};

/// The planes of the options' field, for a motion range of `range`. Errors of make_light_slab().
LightSlab sized_planes(const FieldSource& source,
                       const PrecomputeOptions& options,
                       const MotionRange& range,
                       const DepthSlabs& depth_slabs);

/// Collective. Every part with the planes that its depth slabs take. Errors of make_light_slab().
std::vector<FieldPart> with_planes(std::vector<FieldPart> parts,
                                   const PrecomputeOptions& options,
                                   const Communicator& communicator);

/// Whether the caster, a probe or the cut into slabs reads the resampled CT.
bool needs_resampled_ct(const PrecomputeOptions& options);

/// Collective. Every part cut into the depth slabs of the options' design, with planes for them;
/// the resampled CT is let go where the caster does not need it. Errors of choose_depth_slabs().
std::vector<FieldPart> cut_into_slabs(std::vector<FieldPart> parts,
                                      const PrecomputeOptions& options,
                                      const Communicator& communicator);

/// Collective. The field, where its options state a spacing, with nodes of its (s,t) planes that
/// stand at most so far apart on every one of them; otherwise the fewest that do, a multiple of 32,
/// so that levels of the pyramid halve them evenly. InputError beyond kMostPlaneNodes.
SizedField with_nodes_of_spacing(SizedField field, const Communicator& communicator);

/// Collective. The memory of a rank in each phase; what it has now counts as fixed.
MemoryPlan memory_plan(const SizedField& field,
                       const std::vector<WorkUnit>& units,
                       const PrecomputeRun& run);

/// Collective. Peak memory since forget_peak(), beside the CT and its grid, of the rank that had
/// most.
std::uint64_t peak_bytes_of_a_rank(const SizedField& field, const PrecomputeRun& run);

}  // namespace af
