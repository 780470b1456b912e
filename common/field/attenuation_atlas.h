// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "field/compressed_attenuation_field.h"

namespace af {

/// One field of an atlas, without what all of them share.
struct AtlasMember {
  FieldIdentity identity;
  LightSlab light_slab;
};

/// Fields of one CT, such as those of a C-arm's orbit, that share a quantiser and a codebook. The
/// atlas holds no indices: they are read member by member, as they are needed.
struct AttenuationAtlas {
  /// The camera and frame from which the members were derived, and the range about the nominal pose
  /// that they hold together at each of their angles.
  FieldIdentity identity;
  std::vector<AtlasMember> members;
  float quantizer_step = 0.0f;
  Codebook codebook;

  /// The slabs of all members, those of the first member first.
  [[nodiscard]] FieldLattice lattice() const {
    FieldLattice all;
    for (const AtlasMember& member : members)
      for (const SlabLattice& slab : member.light_slab.lattice().slabs) all.slabs.push_back(slab);
    return all;
  }
  /// A member as a field, without indices.
  [[nodiscard]] CompressedAttenuationField field(std::size_t member) const {
    return {members[member].identity, members[member].light_slab, quantizer_step, codebook, {}};
  }
};

}  // namespace af
