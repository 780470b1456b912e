// SPDX-License-Identifier: Apache-2.0
#include "benchmark/machine_kernel.h"

#include "base/processor.h"

namespace af::AF_KERNEL_NAMESPACE {

using namespace lanes16;

namespace {

AF_KERNEL_INLINE int32_t sum_of_lanes(Ints16 value) {
  int32_t sum = 0;
  for (int lane = 0; lane < kLanes; ++lane) sum ^= value[lane];
  return sum;
}

}  // namespace

int32_t read_all(const int32_t* values, size_t count, size_t repetitions) {
  Ints16 sums[4] = {};
  for (size_t repetition = 0; repetition < repetitions; ++repetition)
    for (size_t i = 0; i + 4 * kLanes <= count; i += 4 * kLanes)
      for (size_t j = 0; j < 4; ++j) sums[j] += load<Ints16>(values + i + j * kLanes);
  return sum_of_lanes(sums[0] + sums[1] + sums[2] + sums[3]);
}

int32_t multiply_add_pairs(const int32_t* values, size_t count, size_t repetitions) {
  native::Register sums[8];
  native::Register factors[8];
  for (int j = 0; j < 8; ++j) {
    sums[j] = native::splat_int(j);
    factors[j] = native::splat_int(values[j]);
  }
  for (size_t repetition = 0; repetition < repetitions; ++repetition)
    for (size_t i = 0; i < count; ++i) {
      const native::Register weight = native::splat_int(values[i]);
      for (int j = 0; j < 8; ++j)
        sums[j] = native::add_ints(sums[j], native::multiply_add_pairs(factors[j], weight));
    }
  int32_t result = 0;
  for (const native::Register& sum : sums) {
    int32_t first = 0;
    memcpy(&first, &sum, sizeof(first));
    result ^= first;
  }
  return result;
}

int32_t squared_differences(const int32_t* values, size_t count, size_t repetitions) {
  Floats16 sums[8] = {};
  Floats16 points[8];
  for (int j = 0; j < 8; ++j) points[j] = splat(static_cast<float>(j));
  for (size_t repetition = 0; repetition < repetitions; ++repetition)
    for (size_t i = 0; i < count; ++i) {
      const Floats16 value = splat(static_cast<float>(values[i]));
      for (int j = 0; j < 8; ++j) {
        const Floats16 difference = value - points[j];
        sums[j] += difference * difference;
      }
    }
  Floats16 total = {};
  for (const Floats16& sum : sums) total += sum;
  return sum_of_lanes(reinterpret_cast<Ints16>(total));
}

int32_t gather_all(const int32_t* values, size_t count, size_t repetitions) {
  // Lanes lie a prime number of values apart, as scattered as samples of neighbouring rays. `count`
  // is a power of two of at least 4096.
  const Ints16 lanes = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
  const int32_t stride = 67;
  Ints16 sum = {};
  for (size_t repetition = 0; repetition < repetitions; ++repetition)
    for (size_t i = 0; i < count; ++i) {
      const int32_t first = static_cast<int32_t>((i * 31) & (count / 2 - 1));
      const Ints16 offset = (lanes * stride + first) * 2;
      sum += gather_pairs(reinterpret_cast<const uint16_t*>(values), offset);
    }
  return sum_of_lanes(sum);
}

}  // namespace af::AF_KERNEL_NAMESPACE
