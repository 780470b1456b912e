// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "precompute/field_parts.h"
#include "run/deciding_values.h"

namespace af {

/// Everything that decides the cast samples. Options of the codebook may change between a stop and
/// its resume, for example after "more codewords than training tiles".
DecidingValues casting_decides(const PrecomputeOptions& options,
                               const FieldSource& source,
                               const std::vector<FieldPart>& parts);

}  // namespace af
