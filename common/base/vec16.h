// SPDX-License-Identifier: Apache-2.0
// For kernels only (see af_add_kernel): vectors of 16 lanes by compiler vector extensions. A vector
// is one 512-bit register, or two of 256, or four of 128 bits; operations are per lane and never
// fused, so every width gives identical bits.
#pragma once

#include <stdint.h>
#include <string.h>

#if AF_VECTOR_BITS > 128
#include <immintrin.h>
#endif

#define AF_KERNEL_INLINE static inline __attribute__((always_inline))

namespace af::AF_KERNEL_NAMESPACE {

inline constexpr int kLanes = 16;

using F16 = float __attribute__((vector_size(64)));
using I16 = int32_t __attribute__((vector_size(64)));
using U16 = uint32_t __attribute__((vector_size(64)));

AF_KERNEL_INLINE F16 splat(float value) {
  return value - F16{};
}
AF_KERNEL_INLINE I16 splat(int32_t value) {
  return value - I16{};
}

template <typename Vector, typename Element>
AF_KERNEL_INLINE Vector load(const Element* from) {
  static_assert(sizeof(Vector) == kLanes * sizeof(Element));
  Vector vector;
  memcpy(&vector, from, sizeof(vector));
  return vector;
}

template <typename Vector, typename Element>
AF_KERNEL_INLINE void store(Element* to, Vector vector) {
  static_assert(sizeof(Vector) == kLanes * sizeof(Element));
  memcpy(to, &vector, sizeof(vector));
}

/// Truncation towards zero.
AF_KERNEL_INLINE I16 to_int(F16 value) {
  return __builtin_convertvector(value, I16);
}
AF_KERNEL_INLINE F16 to_float(I16 value) {
  return __builtin_convertvector(value, F16);
}

AF_KERNEL_INLINE F16 minimum(F16 a, F16 b) {
  return a < b ? a : b;
}
AF_KERNEL_INLINE F16 maximum(F16 a, F16 b) {
  return a > b ? a : b;
}

AF_KERNEL_INLINE I16 minimum(I16 a, I16 b) {
  return a < b ? a : b;
}

/// True when any lane of a comparison's result is set.
AF_KERNEL_INLINE bool any(I16 mask) {
#if AF_VECTOR_BITS == 512
  __m512i bits;
  memcpy(&bits, &mask, sizeof(bits));
  return _mm512_test_epi32_mask(bits, bits) != 0;
#else
  uint64_t words[8];
  memcpy(words, &mask, sizeof(words));
  return (words[0] | words[1] | words[2] | words[3] | words[4] | words[5] | words[6] | words[7]) !=
         0;
#endif
}

/// base[offset] per lane.
AF_KERNEL_INLINE F16 gather(const float* base, I16 offset) {
  F16 values;
#if AF_VECTOR_BITS == 512
  __m512i index;
  memcpy(&index, &offset, sizeof(index));
  const __m512 gathered = _mm512_i32gather_ps(index, base, 4);
  memcpy(&values, &gathered, sizeof(values));
#elif AF_VECTOR_BITS == 256
  __m256i index[2];
  memcpy(index, &offset, sizeof(index));
  const __m256 gathered[2] = {_mm256_i32gather_ps(base, index[0], 4),
                              _mm256_i32gather_ps(base, index[1], 4)};
  memcpy(&values, gathered, sizeof(values));
#else
  for (int lane = 0; lane < kLanes; ++lane) values[lane] = base[offset[lane]];
#endif
  return values;
}

/// Two neighbouring 16-bit elements, base[offset] in the low and base[offset + 1] in the high half
/// of each lane.
AF_KERNEL_INLINE I16 gather_pairs(const uint16_t* base, I16 offset) {
  I16 pairs;
#if AF_VECTOR_BITS == 512
  __m512i index;
  memcpy(&index, &offset, sizeof(index));
  const __m512i gathered = _mm512_i32gather_epi32(index, base, 2);
  memcpy(&pairs, &gathered, sizeof(pairs));
#elif AF_VECTOR_BITS == 256
  __m256i index[2];
  memcpy(index, &offset, sizeof(index));
  const int* words = reinterpret_cast<const int*>(base);
  const __m256i gathered[2] = {_mm256_i32gather_epi32(words, index[0], 2),
                               _mm256_i32gather_epi32(words, index[1], 2)};
  memcpy(&pairs, gathered, sizeof(pairs));
#else
  for (int lane = 0; lane < kLanes; ++lane) {
    int32_t pair = 0;
    memcpy(&pair, base + offset[lane], sizeof(pair));
    pairs[lane] = pair;
  }
#endif
  return pairs;
}

}  // namespace af::AF_KERNEL_NAMESPACE
