// SPDX-License-Identifier: Apache-2.0
// A build from the plan to the codebook: each phase with its progress, its messages and what a
// later run finds of it.
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

/// Collective. Units as an earlier run has begun them, else such as suit the ranks. InputError when
/// the memory limit is too low, before anything is made, and as UnitStore.
PlannedUnits planned_units(const SizedField& field, const PrecomputeRun& run);

/// Collective. cast_field() within the memory limit. StoppedError with all units saved.
CastPhase cast_units(const FieldBuild& build, const SizedField& field, PrecomputeRun& run);

/// Collective. choose_overflow() where tiles were not kept; says where the tiles are.
OverflowChoice chosen_overflow(const FieldBuild& build, const CastPhase& cast);

struct TrainedField {
  TrainedCodebook training;            ///< its codebook has the filter
  std::size_t iterations_resumed = 0;  ///< of it, by earlier runs
  FittedFilter fitted;                 ///< without a filter where the design has none
};

/// Collective. The codebook, and the filter where the design has one. If options are refused only
/// now, marks the unfinished work so that a later run with other options may discard it without
/// --restart. InputError when no ray meets anything but air, and as train_field().
TrainedField trained_field(const FieldBuild& build,
                           const DecidingValues& decides,
                           const SizedField& field,
                           CastPhase& cast,
                           PrecomputeRun& run);

}  // namespace af
