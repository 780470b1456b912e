// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "field/compressed_attenuation_field.h"
#include "field_file/field_file.h"

namespace af::fuzz {

/// A sound field of two slabs, small enough to be written thousands of times; without its indices.
CompressedAttenuationField sample_field();
/// The same of mean-removed tiles.
CompressedAttenuationField sample_field_with_means();

/// All its tiles, one block per slab.
std::vector<IndexBlock> sample_blocks(const CompressedAttenuationField& field);

}  // namespace af::fuzz
