// SPDX-License-Identifier: Apache-2.0
#include "precompute/build_phases.h"

#include <sstream>
#include <string>
#include <utility>

#include "base/error.h"
#include "files/options_toml.h"
#include "precompute/build/training_journal.h"
#include "precompute/cast_dependencies.h"
#include "precompute/formatted_text.h"
#include "ranks/progress_printer.h"
#include "ranks/terminal.h"
#include "ranks/work_watch.h"

namespace af {

namespace {

std::string tile_bytes_text(const CastPhase& cast) {
  return megabytes_text(cast.occupied_tiles * sizeof(Tile));
}

void require_something_seen(const CastPhase& cast, const SizedField& field) {
  if (cast.occupied_tiles > 0) return;
  throw InputError("camera",
                   field.source.camera.name,
                   "its detector misses the CT: no ray to it meets anything but air, wherever "
                   "the CT is within the range; check the rig, the nominal pose and the centre");
}

/// Collective. Trains without a filter.
TrainedField train(const FieldBuild& build,
                   DecidingValues decides,
                   const SizedField& field,
                   CastPhase& cast,
                   PrecomputeRun& run) {
  const CodebookOptions options = field.options.codebook_options();
  ProgressPrinter printer("training the codebook", run.world.is_root());
  const auto iteration = [](std::size_t done) {
    return "training the codebook, iteration " + std::to_string(done + 1);
  };
  std::optional<TrainingJournal> journal;
  TrainingCheckpoints checkpoints;
  WorkNote note(iteration(0));
  if (build.progress != nullptr) {
    const OptionTexts of_codebook = deciding_options(field.options, kCodebookStage);
    decides.insert(of_codebook.begin(), of_codebook.end());
    journal.emplace(run.folder.unfinished("training", decides), options, run.world);
    checkpoints.begun = journal->begun();
    checkpoints.on_iteration = [&](const TrainedCodebook& so_far) {
      journal->append(so_far);
      note.change(iteration(so_far.iterations.size()));
      run.folder.stop_if_requested("with all units and " +
                                   std::to_string(so_far.iterations.size()) +
                                   " iterations of the training saved");
    };
  }
  const std::size_t resumed = checkpoints.begun ? checkpoints.begun->iterations.size() : 0;
  if (resumed > 0)
    inform(run.world, "resumed " + std::to_string(resumed) + " iterations of the training");
  TrainedCodebook training = train_field(build, cast, options, printer.callback(), checkpoints);
  run.clock.end("train");
  return {std::move(training), resumed, {}};
}

/// Collective.
TrainedField train_or_give_way(const FieldBuild& build,
                               const DecidingValues& decides,
                               const SizedField& field,
                               CastPhase& cast,
                               PrecomputeRun& run) {
  try {
    all_or_none(run.world, [&] { require_something_seen(cast, field); });
    return train(build, decides, field, cast, run);
  } catch (const Error& error) {
    if (error.exit_code() == ExitCode::Input && build.progress != nullptr)
      build.progress->give_way();
    throw;
  }
}

/// Collective.
FittedFilter fitted_filter(const FieldBuild& build,
                           const Codebook& codebook,
                           const SizedField& field,
                           PrecomputeRun& run) {
  const WorkNote note("fitting the tile filter");
  FittedFilter fitted = fit_filter(build, codebook, field.options.seed);
  if (!fitted.filter)
    inform(run.world,
           "tile filter: none, " + std::to_string(fitted.tiles) + " tiles are too few to fit one");
  run.clock.end("fit filter");
  return fitted;
}

}  // namespace

PlannedUnits planned_units(const SizedField& field, const PrecomputeRun& run) {
  const PlanOptions plan = field.unit_plan(run.world.size());
  const MemoryPlan memory = memory_plan(field, plan_units(field.lattice, plan), run);
  all_or_none(run.world, [&] { (void)memory_limit(field.options, memory); });
  PlannedUnits planned;
  planned.decides = cast_dependencies(field.options, field.source, field.parts);
  UnfinishedWork work = run.folder.unfinished("units", planned.decides);
  work.unit_size = plan.rays_per_unit;
  std::optional<UnitStore>& progress = planned.progress;
  if (field.options.has_checkpoint) progress.emplace(work, run.world);
  if (progress.has_value() && progress->has_replaced_refused())
    inform(
        run.world,
        "unfinished work in " + progress->path().string() +
            " is discarded: the options that it was made with were refused; this run has others");
  planned.units = plan_units(field.lattice,
                             {progress.has_value() ? progress->rays_per_unit() : work.unit_size});
  return planned;
}

CastPhase cast_units(const FieldBuild& build, const SizedField& field, PrecomputeRun& run) {
  const MemoryPlan plan = memory_plan(field, build.units, run);
  const std::uint64_t limit =
      all_or_none(run.world, [&] { return memory_limit(field.options, plan); });
  forget_peak();
  ProgressPrinter printer("casting", run.world.is_root());
  CastPhase cast = cast_field(build,
                              {field.options.training_selection(), plan.kept_tile_bytes(limit)},
                              run.stop_requested(),
                              printer.callback());
  run.clock.end("cast");
  if (cast.units_resumed > 0)
    inform(run.world,
           "resumed " + std::to_string(cast.units_resumed) + " of " +
               std::to_string(build.units.size()) + " units from " +
               build.progress->path().string());
  run.folder.stop_if_requested("with all units saved");
  return cast;
}

OverflowChoice chosen_overflow(const FieldBuild& build, const CastPhase& cast) {
  const std::size_t units = build.units.size();
  if (cast.units_kept == units) {
    inform(build.communicator, "tiles: all " + tile_bytes_text(cast) + " kept in memory");
    return {};
  }
  const OverflowChoice choice = choose_overflow(build, cast);
  std::ostringstream text;
  text.precision(3);
  text << "tiles: " << cast.units_kept << " of " << units << " units (" << tile_bytes_text(cast)
       << " in all) kept in memory; the others are "
       << (choice.overflow == TileOverflow::ReadBack
               ? "read back from " + build.progress->path().string()
               : "cast again");
  if (choice.read_bytes_per_second > 0.0)
    text << " (a rank reads " << choice.read_bytes_per_second / 1e6 << " MB/s, casts "
         << choice.cast_bytes_per_second / 1e6 << " MB/s)";
  inform(build.communicator, text.str());
  return choice;
}

TrainedField trained_field(const FieldBuild& build,
                           const DecidingValues& decides,
                           const SizedField& field,
                           CastPhase& cast,
                           PrecomputeRun& run) {
  TrainedField trained = train_or_give_way(build, decides, field, cast, run);
  Codebook& codebook = trained.training.codebook;
  if (field.options.design().filters_tiles)
    trained.fitted = fitted_filter(build, codebook, field, run);
  codebook.filter = trained.fitted.filter;
  return trained;
}

}  // namespace af
