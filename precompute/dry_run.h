// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "precompute/casting/field_caster.h"
#include "precompute/precompute_run.h"
#include "precompute/sized_field.h"

namespace af {

/// Collective. Prints what making the field would need: sizes, units, memory, ratios, time, advice,
/// from short samples of the work on rank 0. Throws InputError when the memory limit is too low.
void print_dry_run(const SizedField& field, const FieldCaster& caster, const PrecomputeRun& run);

}  // namespace af
