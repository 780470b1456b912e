// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "precompute/field_parts.h"
#include "run/deciding_values.h"

namespace af {

/// Everything on which the cast samples depend: units of unfinished work are taken over only where
/// all of it is equal. Options of the codebook may change between a stop and its resume, for
/// example after "more codewords than training tiles".
DecidingValues cast_dependencies(const PrecomputeOptions& options,
                                 const FieldSource& source,
                                 const std::vector<FieldPart>& parts);

}  // namespace af
