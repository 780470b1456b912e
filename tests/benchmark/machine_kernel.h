// SPDX-License-Identifier: Apache-2.0
// Loops that do one kind of work as fast as a core can. They bound what the phases of a field can
// reach.
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace af::benchmark {

/// Runs `repetitions` over `values` (whole vectors of 16) and returns something that depends on all
/// of it.
using MachineLoop = int32_t (*)(const int32_t* values, size_t count, size_t repetitions);

}  // namespace af::benchmark

#define AF_DECLARE_MACHINE_LOOPS(name_space)                                            \
  namespace af::name_space {                                                            \
  /* Sum of all values: bandwidth of reading from wherever they lie. */                 \
  int32_t read_all(const int32_t* values, size_t count, size_t repetitions);            \
  /* 8 multiply-adds of pairs of 16-bit values into as many sums per `count` of one. */ \
  int32_t multiply_add_pairs(const int32_t* values, size_t count, size_t repetitions);  \
  /* 8 squared differences of floats (subtract, multiply, add) per `count` of one. */   \
  int32_t squared_differences(const int32_t* values, size_t count, size_t repetitions); \
  /* One gather of 16 values per `count` of one, at scattered places. */                \
  int32_t gather_all(const int32_t* values, size_t count, size_t repetitions);          \
  }
AF_DECLARE_MACHINE_LOOPS(kernels_128)
AF_DECLARE_MACHINE_LOOPS(kernels_256)
AF_DECLARE_MACHINE_LOOPS(kernels_512)
#undef AF_DECLARE_MACHINE_LOOPS
