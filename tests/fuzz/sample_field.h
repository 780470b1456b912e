// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "field/attenuation_atlas.h"
#include "field/compressed_attenuation_field.h"
#include "field/field_writing.h"

namespace af::fuzz {

/// A sound field of two slabs, small enough to be written thousands of times; without its indices.
CompressedAttenuationField sample_field();
/// The same of mean-removed tiles.
CompressedAttenuationField sample_field_with_means();

/// Two members beside each other, with the codebook of either.
AttenuationAtlas sample_atlas(const CompressedAttenuationField& field);

/// All tiles of all slabs, one block per slab.
std::vector<IndexBlock> sample_blocks(const FieldLattice& lattice, bool has_means);

}  // namespace af::fuzz
