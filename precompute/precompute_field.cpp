// SPDX-License-Identifier: Apache-2.0
#include "precompute/precompute_field.h"

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "base/error.h"
#include "field/parallel_write_check.h"
#include "precompute/build_phases.h"
#include "precompute/design_choice.h"
#include "precompute/dry_run.h"
#include "precompute/field_output.h"
#include "precompute/field_parts.h"
#include "precompute/field_source.h"
#include "precompute/precompute_run.h"
#include "precompute/sized_field.h"
#include "ranks/work_watch.h"

namespace af {

namespace {

/// Collective.
PrecomputeOptions options_in_force(const PrecomputeOptions& stated, const Communicator& world) {
  return all_or_none(world, [&] {
    // The stated options are checked first, because only known names are in force.
    throw_if_any(problems(stated));
    PrecomputeOptions options = stated.in_force();
    throw_if_any(problems(options));
    if (!options.is_dry_run && options.output.empty())
      throw UsageError("-o FIELD.h5 is needed (or --dry-run)");
    return options;
  });
}

/// Collective. From the CT to the planes between which rays are cast.
SizedField sized_field(const PrecomputeOptions& options, PrecomputeRun& run) {
  const Communicator& world = run.world;
  WorkNote note("reading the CT", WorkNote::Kind::Phase);
  const FieldSource source = load_source(options, world);
  // At first there is one central slab: resampling needs only the slab frame, and cutting the CT
  // into slabs needs the resampled CT.
  std::vector<FieldPart> central = with_planes(field_parts(source, options, world), options, world);
  run.clock.end("read");
  if (!needs_resampled_ct(options))
    return with_nodes_of_spacing({options, std::nullopt, source, std::move(central)}, world);
  std::vector<FieldPart> resampled = with_resampled_ct(std::move(central), note, world);
  run.clock.end("resample");
  const std::optional<DesignChoice> choice = chosen_design(resampled, options, run);
  const PrecomputeOptions designed =
      choice ? options.with_design(choice->chosen.forecast.design).in_force() : options;
  std::vector<FieldPart> cut = cut_into_slabs(std::move(resampled), designed, world);
  return with_nodes_of_spacing({designed, choice, source, std::move(cut)}, world);
}

/// Whether a stop saves the finished work.
bool keeps_progress(const PrecomputeOptions& options) {
  return options.has_checkpoint && !options.is_dry_run;
}

}  // namespace

void run_precompute(const PrecomputeOptions& stated,
                    const std::string& command_line,
                    const Communicator& world) {
  PrecomputeRun run{world,
                    command_line,
                    {{stated.output, {}, stated.is_restart, keeps_progress(stated)}, world},
                    world.node().size(),
                    {}};
  const PrecomputeOptions options = options_in_force(stated, world);
  if (!options.is_dry_run) open_output(options, run);
  const SizedField field = sized_field(options, run);
  run.folder.stop_if_requested("before the first unit");
  const std::unique_ptr<const FieldCaster> caster = make_caster(field.parts, field.options);
  if (options.is_dry_run) {
    print_dry_run(field, *caster, run);
    return;
  }
  check_writing_many_chunks(field.lattice, options.output, world, mpi_io_hints(options));
  PlannedUnits planned = planned_units(field, run);
  const FieldBuild build{*caster,
                         field.lattice,
                         planned.units,
                         costs_over_parts(planned.units, field.parts),
                         planned.progress ? &*planned.progress : nullptr,
                         world};
  CastPhase cast = cast_units(build, field, run);
  const OverflowChoice overflow = chosen_overflow(build, cast);
  const TrainedField trained = trained_field(build, planned.decides, field, cast, run);
  write_encoded(build, field, cast, trained, overflow, run);
}

}  // namespace af
