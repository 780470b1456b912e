// SPDX-License-Identifier: Apache-2.0
// For kernels only (see af_add_kernel): vectors of 16 lanes by compiler vector extensions. A vector
// is one 512-bit register, or two of 256, or four of 128 bits; operations are per lane and never
// fused, so every width gives identical bits.
#pragma once

#include <immintrin.h>
#include <stdint.h>
#include <string.h>

#include "base/kernel_inline.h"

namespace af::AF_KERNEL_NAMESPACE {

inline constexpr int kLanes = 16;

using Floats16 = float __attribute__((vector_size(64)));
using Ints16 = int32_t __attribute__((vector_size(64)));
using UnsignedInts16 = uint32_t __attribute__((vector_size(64)));
/// Thirty-two 16-bit lanes, for integer arithmetic on samples.
using Shorts32 = int16_t __attribute__((vector_size(64)));

AF_KERNEL_INLINE Floats16 splat(float value) {
  return value - Floats16{};
}
AF_KERNEL_INLINE Ints16 splat(int32_t value) {
  return value - Ints16{};
}

template <typename Vector, typename Element>
AF_KERNEL_INLINE Vector load(const Element* from) {
  static_assert(sizeof(Vector) == 64 && sizeof(Vector{}[0]) == sizeof(Element));
  Vector vector;
  memcpy(&vector, from, sizeof(vector));
  return vector;
}

template <typename Vector, typename Element>
AF_KERNEL_INLINE void store(Element* to, Vector vector) {
  static_assert(sizeof(Vector) == 64 && sizeof(Vector{}[0]) == sizeof(Element));
  memcpy(to, &vector, sizeof(vector));
}

/// Truncation towards zero.
AF_KERNEL_INLINE Ints16 to_int(Floats16 value) {
  return __builtin_convertvector(value, Ints16);
}
AF_KERNEL_INLINE Floats16 to_float(Ints16 value) {
  return __builtin_convertvector(value, Floats16);
}

// The registers that make up one 64-byte vector, and the intrinsics of that width.
#if AF_VECTOR_BITS == 512
#define AF_INTRINSIC(operation) _mm512_##operation
using IntegerRegister = __m512i;
using FloatRegister = __m512;
#elif AF_VECTOR_BITS == 256
#define AF_INTRINSIC(operation) _mm256_##operation
using IntegerRegister = __m256i;
using FloatRegister = __m256;
#else
#define AF_INTRINSIC(operation) _mm_##operation
using IntegerRegister = __m128i;
using FloatRegister = __m128;
#endif
inline constexpr int kRegisters = 512 / AF_VECTOR_BITS;

#define AF_DEFINE_OPERATION(name, operation, Register, Result, Operand)                        \
  AF_KERNEL_INLINE Result name(Operand a, Operand b) {                                         \
    Register left[kRegisters];                                                                 \
    Register right[kRegisters];                                                                \
    memcpy(left, &a, sizeof(left));                                                            \
    memcpy(right, &b, sizeof(right));                                                          \
    for (int i = 0; i < kRegisters; ++i) left[i] = AF_INTRINSIC(operation)(left[i], right[i]); \
    Result result;                                                                             \
    memcpy(&result, left, sizeof(result));                                                     \
    return result;                                                                             \
  }

/// a < b ? a : b per lane.
AF_DEFINE_OPERATION(minimum, min_ps, FloatRegister, Floats16, Floats16)
AF_DEFINE_OPERATION(minimum, min_epi32, IntegerRegister, Ints16, Ints16)
/// a > b ? a : b per lane.
AF_DEFINE_OPERATION(maximum, max_ps, FloatRegister, Floats16, Floats16)
AF_DEFINE_OPERATION(maximum, max_epi32, IntegerRegister, Ints16, Ints16)
/// Saturated to 0 ... 65535 (as bits); within each group of 8 lanes: a's four, then b's four.
AF_DEFINE_OPERATION(pack_unsigned, packus_epi32, IntegerRegister, Shorts32, Ints16)

#undef AF_DEFINE_OPERATION

/// True when any lane of a comparison's result is set.
AF_KERNEL_INLINE bool any(Ints16 mask) {
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

/// Two neighbouring 16-bit elements, base[offset] in the low and base[offset + 1] in the high half
/// of each lane.
AF_KERNEL_INLINE Ints16 gather_pairs(const uint16_t* base, Ints16 offset) {
  Ints16 pairs;
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

AF_KERNEL_INLINE Floats16 square_root(Floats16 value) {
  FloatRegister parts[kRegisters];
  memcpy(parts, &value, sizeof(parts));
  for (int i = 0; i < kRegisters; ++i) parts[i] = AF_INTRINSIC(sqrt_ps)(parts[i]);
  memcpy(&value, parts, sizeof(value));
  return value;
}

}  // namespace af::AF_KERNEL_NAMESPACE
