// SPDX-License-Identifier: Apache-2.0
#include "precompute/casting/joined_caster.h"

#include <utility>

#include "base/error.h"

namespace af {

std::vector<SlabPlace> slab_places(const std::vector<std::size_t>& slab_counts) {
  std::vector<SlabPlace> places;
  for (std::size_t field = 0; field < slab_counts.size(); ++field)
    for (std::size_t slab = 0; slab < slab_counts[field]; ++slab) places.push_back({field, slab});
  return places;
}

JoinedCaster::JoinedCaster(std::vector<std::unique_ptr<const FieldCaster>> casters,
                           const std::vector<std::size_t>& slab_counts)
    : casters_(std::move(casters)), places_(slab_places(slab_counts)) {
  check(casters_.size() == slab_counts.size(), "one caster per field");
}

void JoinedCaster::cast(const WorkUnit& unit, std::span<std::uint16_t> samples) const {
  const SlabPlace& place = places_.at(unit.slab);
  WorkUnit of_field = unit;
  of_field.slab = place.slab;
  casters_[place.field]->cast(of_field, samples);
}

}  // namespace af
