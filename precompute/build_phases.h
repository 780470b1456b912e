// SPDX-License-Identifier: Apache-2.0
// A build from the plan to the codebook. Each phase has its progress, its messages and what a later
// run finds of it.
#pragma once

#include <optional>
#include <vector>

#include "precompute/build/field_build.h"
#include "precompute/codebook/codebook_training.h"
#include "precompute/codebook/filter_fitting.h"
#include "precompute/precompute_run.h"
#include "precompute/sized_field.h"
#include "ranks/deciding_values.h"

namespace af {

/// The units of a field, and where finished ones are kept.
struct PlannedUnits {
  DecidingValues decides;             ///< what the samples of a unit depend on
  std::optional<UnitStore> progress;  ///< none: nothing is kept
  std::vector<WorkUnit> units;
};

/// Collective. Units as an earlier run began them, or else units that suit the ranks. Throws
/// InputError when the memory limit is too low, before anything is made, and as UnitStore does.
PlannedUnits planned_units(const SizedField& field, const PrecomputeRun& run);

/// Collective. cast_field() within the memory limit. Throws StoppedError with all units saved.
CastPhase cast_units(const FieldBuild& build, const SizedField& field, PrecomputeRun& run);

/// Collective. choose_overflow() where tiles were not kept. Says where the tiles are.
OverflowChoice chosen_overflow(const FieldBuild& build, const CastPhase& cast);

struct TrainedField {
  TrainedCodebook training;            ///< its codebook has the filter
  std::size_t iterations_resumed = 0;  ///< how many of its iterations earlier runs made
  FittedFilter fitted;                 ///< without a filter where the design has none
};

/// Collective. The codebook, and the filter where the design has one. If options are refused only
/// now, marks the unfinished work so that a later run with other options may discard it without
/// --restart. Throws InputError when no ray meets anything but air, and as train_field() does.
TrainedField trained_field(const FieldBuild& build,
                           const DecidingValues& decides,
                           const SizedField& field,
                           CastPhase& cast,
                           PrecomputeRun& run);

}  // namespace af
