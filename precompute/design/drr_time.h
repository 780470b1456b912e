// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "precompute/design/field_design.h"

namespace af {

/// Estimates the milliseconds for one DRR by look-up in two passes on one core of some 3 GHz, for
/// this many pixels, and this many (s,t) nodes of a slab under them.
double estimated_drr_ms(const FieldDesign& design, double pixels, double nodes);

}  // namespace af
