// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "base/shared_array.h"
#include "geometry/ct_grid.h"

namespace af {

/// A CT in Hounsfield units, i fastest. The reader checks the geometry: direction orthonormal,
/// spacing positive.
struct CtVolume {
  CtGrid grid;
  SharedArray<std::int16_t> hu;
};

}  // namespace af
