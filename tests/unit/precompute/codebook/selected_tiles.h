// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "precompute/codebook/tile_selection.h"

namespace af::test {

/// The training share of a rank that has cast all `units`.
inline TrainingShare select_training_tiles(std::span<const UnitTiles> tiles,
                                           std::span<const WorkUnit> units,
                                           const FieldLattice& lattice,
                                           const TrainingSelection& selection) {
  TrainingTilePicker picker(selection, lattice);
  for (const UnitTiles& of_unit : tiles) picker.add(of_unit, units[of_unit.unit_id]);
  return picker.take(serial_reduction());
}

}  // namespace af::test
