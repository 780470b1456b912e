// SPDX-License-Identifier: Apache-2.0
#include "precompute/sized_field.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "base/error.h"
#include "field/field_reading.h"
#include "files/toml_reader.h"
#include "geometry/slab_sizing.h"
#include "precompute/casting/casters.h"
#include "precompute/formatted_text.h"
#include "ranks/terminal.h"

namespace af {

namespace {

/// Collective.
void size_planes(FieldPart& part,
                 const PrecomputeOptions& options,
                 const Communicator& communicator) {
  part.light_slab = all_or_none(communicator, [&] {
    return sized_planes(part.source, options, part.source.range, part.depth_slabs);
  });
  share_geometry(part.light_slab, communicator);
}

bool has_one_central_slab(const PrecomputeOptions& options) {
  return options.design().slabs == 1 && options.st_plane_rule() == StPlane::Centre;
}

int st_nodes_at_most_apart(const std::vector<FieldPart>& parts, double spacing_mm) {
  constexpr int kMultiple = 32;
  double longest_mm = 0.0;
  int present = 0;
  for (const FieldPart& part : parts)
    for (const SlabGeometry& slab : part.light_slab.slabs) {
      longest_mm = std::max({longest_mm, slab.s.length_mm(), slab.t.length_mm()});
      present = std::max({present, slab.s.nodes, slab.t.nodes});
    }
  const double nodes = std::ceil(longest_mm / spacing_mm) + 1.0;
  if (nodes <= present) return present;
  if (!(nodes <= kMostPlaneNodes))
    throw InputError("--st-spacing-mm",
                     toml_number(spacing_mm),
                     "an (s,t) plane is " + formatted("%.1f", longest_mm) + " mm wide and has " +
                         std::to_string(kMostPlaneNodes) + " nodes at most, " +
                         formatted("%.4g", 1.001 * longest_mm / (kMostPlaneNodes - 1)) +
                         " mm apart");
  return (static_cast<int>(nodes) + kMultiple - 1) / kMultiple * kMultiple;
}

/// A rank that is alone on its node holds the CT and its grid as memory of its own.
std::uint64_t without_volume(std::uint64_t own_bytes,
                             const SizedField& field,
                             const PrecomputeRun& run) {
  return run.ranks_on_node > 1 ? own_bytes : own_bytes - std::min(own_bytes, field.volume_bytes());
}

/// Collective.
std::uint64_t largest_over_ranks(std::uint64_t bytes, const Communicator& communicator) {
  std::array<std::uint64_t, 1> largest{bytes};
  communicator.maximum(largest);
  return largest[0];
}

}  // namespace

std::uint64_t SizedField::volume_bytes() const {
  std::uint64_t bytes = source.volume->voxels().size_bytes();
  if (source.projections != nullptr) bytes += source.projections->bytes;
  for (const FieldPart& part : parts)
    if (part.resampled != nullptr) bytes += part.resampled->bytes();
  return bytes;
}

PlanOptions SizedField::unit_plan(int ranks) const {
  return plan_options_for_ranks(lattice, ranks, caster_named(options.caster).plan);
}

LightSlab sized_planes(const FieldSource& source,
                       const PrecomputeOptions& options,
                       const MotionRange& range,
                       const DepthSlabs& depth_slabs) {
  const FieldDesign design = options.design();
  return make_light_slab(source.camera,
                         source.frame,
                         range,
                         source.volume->corner_points(),
                         {design.uv_nodes,
                          design.st_nodes,
                          depth_slabs.boundaries_y_mm,
                          depth_slabs.st_plane_y_mm,
                          source.sources},
                         source.more_cameras);
}

std::vector<FieldPart> with_planes(std::vector<FieldPart> parts,
                                   const PrecomputeOptions& options,
                                   const Communicator& communicator) {
  for (FieldPart& part : parts) size_planes(part, options, communicator);
  return parts;
}

bool needs_resampled_ct(const PrecomputeOptions& options) {
  return caster_named(options.caster).needs_resampled || options.needs_probe() ||
         !has_one_central_slab(options);
}

std::vector<FieldPart> cut_into_slabs(std::vector<FieldPart> parts,
                                      const PrecomputeOptions& options,
                                      const Communicator& communicator) {
  const bool casting_needs_resampled = caster_named(options.caster).needs_resampled;
  for (FieldPart& part : parts) {
    if (!has_one_central_slab(options))
      part.depth_slabs = all_or_none(communicator, [&] {
        return choose_depth_slabs(*part.resampled, options.design().slabs, options.st_plane_rule());
      });
    size_planes(part, options, communicator);
    if (!casting_needs_resampled) part.resampled = nullptr;
  }
  return parts;
}

SizedField with_nodes_of_spacing(SizedField field, const Communicator& communicator) {
  if (!field.options.st_spacing_mm) return field;
  const double spacing_mm = *field.options.st_spacing_mm;
  const PrecomputeOptions options = field.options.with_st_nodes(
      all_or_none(communicator, [&] { return st_nodes_at_most_apart(field.parts, spacing_mm); }));
  inform(communicator,
         formatted("(s,t) nodes at most %g mm apart: %d along each side of every plane",
                   spacing_mm,
                   *options.st_nodes));
  return {options,
          field.choice,
          field.source,
          with_planes(std::move(field.parts), options, communicator)};
}

MemoryPlan memory_plan(const SizedField& field,
                       const std::vector<WorkUnit>& units,
                       const PrecomputeRun& run) {
  // The ranks of a node share the program's pages, but the first rank counts them too.
  const ProcessMemory now = measured_memory();
  const std::uint64_t fixed =
      largest_over_ranks(without_volume(now.own_bytes, field, run) + now.program_bytes, run.world);
  return plan_memory(field.lattice, units, field.options, fixed, run.world.size());
}

std::uint64_t peak_bytes_of_a_rank(const SizedField& field, const PrecomputeRun& run) {
  return largest_over_ranks(without_volume(measured_memory().peak_own_bytes, field, run),
                            run.world);
}

}  // namespace af
