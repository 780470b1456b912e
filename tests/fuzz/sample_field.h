// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "field/attenuation_atlas.h"
#include "field/compressed_attenuation_field.h"
#include "field/field_writing.h"

namespace af::fuzz {

/// A sound field of two slabs without its indices, small enough to be written thousands of times.
CompressedAttenuationField sample_field();
/// The same with mean-removed tiles.
CompressedAttenuationField sample_field_with_means();

/// An atlas of two members that lie beside each other, with the field's codebook.
AttenuationAtlas sample_atlas(const CompressedAttenuationField& field);

/// All tiles of all slabs, one block per slab.
std::vector<IndexBlock> sample_blocks(const FieldLattice& lattice, bool has_means);

}  // namespace af::fuzz
