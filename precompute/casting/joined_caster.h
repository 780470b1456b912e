// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "precompute/casting/field_caster.h"

namespace af {

/// The field to which a slab belongs when the slabs of several fields are numbered consecutively.
struct SlabPlace {
  std::size_t field = 0;
  std::size_t slab = 0;  ///< within that field
};

/// The place of every slab, in order. `slab_counts`: number of slabs of each field.
std::vector<SlabPlace> slab_places(const std::vector<std::size_t>& slab_counts);

/// Casts units of several fields as if one field had all their slabs, in the order of the fields.
class JoinedCaster final : public FieldCaster {
 public:
  /// One caster per field.
  JoinedCaster(std::vector<std::unique_ptr<const FieldCaster>> casters,
               const std::vector<std::size_t>& slab_counts);

  void cast(const WorkUnit& unit, std::span<std::uint16_t> samples) const override;

 private:
  std::vector<std::unique_ptr<const FieldCaster>> casters_;
  std::vector<SlabPlace> places_;
};

}  // namespace af
