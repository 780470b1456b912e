// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "base/hash_random.h"

namespace af {

/// One draw from the Poisson distribution. Below a mean of 10 it uses products of uniforms (Knuth),
/// above it Hoermann's transformed rejection PTRS (Insurance: Math. and Econ. 12:39, 1993). Both
/// are exact. A mean that is not positive gives 0. \test Poisson.HasMeanAndVarianceOfItsParameter
std::int64_t draw_poisson(double mean, HashRandom& random);

}  // namespace af
