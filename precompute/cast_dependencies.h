// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "precompute/field_parts.h"
#include "ranks/deciding_values.h"

namespace af {

/// Everything on which the cast samples depend, exact except for what may follow from the CT's
/// grid. A resumed run reuses finished units only if all of this is unchanged. Codebook options may
/// change between a stop and its resume, for example after "more codewords than training tiles".
DecidingValues cast_dependencies(const PrecomputeOptions& options,
                                 const FieldSource& source,
                                 const std::vector<FieldPart>& parts);

}  // namespace af
