// SPDX-License-Identifier: Apache-2.0
// For kernels only (see af_add_kernel): vectors of one register, 4, 8 or 16 lanes, for code whose
// lanes are independent. Operations are per lane and never fused, so every width gives identical
// bits. vec16.h has 16 lanes at every width, but GCC keeps vectors of several registers in memory;
// hence this second file.
#pragma once

#include <immintrin.h>
#include <stdint.h>
#include <string.h>

#include "base/kernel_inline.h"

namespace af::AF_KERNEL_NAMESPACE::native {

inline constexpr int kLanes = AF_VECTOR_BITS / 32;

using Floats = float __attribute__((vector_size(AF_VECTOR_BITS / 8)));
using Ints = int32_t __attribute__((vector_size(AF_VECTOR_BITS / 8)));

AF_KERNEL_INLINE Floats splat(float value) {
  return value - Floats{};
}
AF_KERNEL_INLINE Ints splat(int32_t value) {
  return value - Ints{};
}

AF_KERNEL_INLINE Floats load(const float* from) {
  Floats vector;
  memcpy(&vector, from, sizeof(vector));
  return vector;
}

AF_KERNEL_INLINE Ints load(const int32_t* from) {
  Ints vector;
  memcpy(&vector, from, sizeof(vector));
  return vector;
}

/// Unsigned 16-bit elements as floats.
AF_KERNEL_INLINE Floats load(const uint16_t* from) {
#if AF_VECTOR_BITS == 512
  const __m512i samples =
      _mm512_cvtepu16_epi32(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(from)));
#elif AF_VECTOR_BITS == 256
  const __m256i samples =
      _mm256_cvtepu16_epi32(_mm_loadu_si128(reinterpret_cast<const __m128i*>(from)));
#else
  const __m128i samples =
      _mm_cvtepu16_epi32(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(from)));
#endif
  return __builtin_convertvector(reinterpret_cast<Ints>(samples), Floats);
}

/// Unsigned 16-bit levels as floats: the mean plus signed differences, limited to 0 ... 65535.
AF_KERNEL_INLINE Floats load_with_mean(const int16_t* differences, uint16_t mean) {
  // With levels offset by half their range, one signed saturating sum limits them at both ends.
#if AF_VECTOR_BITS == 512
  const __m256i middle = _mm256_set1_epi16(INT16_MIN);
  const __m256i from_middle = _mm256_xor_si256(_mm256_set1_epi16(static_cast<short>(mean)), middle);
  const __m256i sum = _mm256_adds_epi16(
      _mm256_loadu_si256(reinterpret_cast<const __m256i*>(differences)), from_middle);
  const __m512i levels = _mm512_cvtepu16_epi32(_mm256_xor_si256(sum, middle));
#else
  const __m128i middle = _mm_set1_epi16(INT16_MIN);
  const __m128i from_middle = _mm_xor_si128(_mm_set1_epi16(static_cast<short>(mean)), middle);
#if AF_VECTOR_BITS == 256
  const __m128i sum =
      _mm_adds_epi16(_mm_loadu_si128(reinterpret_cast<const __m128i*>(differences)), from_middle);
  const __m256i levels = _mm256_cvtepu16_epi32(_mm_xor_si128(sum, middle));
#else
  const __m128i sum =
      _mm_adds_epi16(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(differences)), from_middle);
  const __m128i levels = _mm_cvtepu16_epi32(_mm_xor_si128(sum, middle));
#endif
#endif
  return __builtin_convertvector(reinterpret_cast<Ints>(levels), Floats);
}

AF_KERNEL_INLINE void store(float* to, Floats vector) {
  memcpy(to, &vector, sizeof(vector));
}
AF_KERNEL_INLINE void store(int32_t* to, Ints vector) {
  memcpy(to, &vector, sizeof(vector));
}

/// Truncation towards zero.
AF_KERNEL_INLINE Ints to_int(Floats value) {
  return __builtin_convertvector(value, Ints);
}
AF_KERNEL_INLINE Floats to_float(Ints value) {
  return __builtin_convertvector(value, Floats);
}

/// 0, 1, 2, ...
AF_KERNEL_INLINE Ints lane_numbers() {
  Ints lanes = splat(0);
  for (int i = 0; i < kLanes; ++i) lanes[i] = i;
  return lanes;
}

#if AF_VECTOR_BITS == 512
#define AF_NATIVE(operation) _mm512_##operation
#elif AF_VECTOR_BITS == 256
#define AF_NATIVE(operation) _mm256_##operation
#else
#define AF_NATIVE(operation) _mm_##operation
#endif

// Registers of the intrinsics are vector types of the same size and convert by a cast.
#if AF_VECTOR_BITS == 512
using IntegerRegister = __m512i;
#elif AF_VECTOR_BITS == 256
using IntegerRegister = __m256i;
#else
using IntegerRegister = __m128i;
#endif

/// a < b ? a : b per lane.
AF_KERNEL_INLINE Floats minimum(Floats a, Floats b) {
  return AF_NATIVE(min_ps)(a, b);
}
AF_KERNEL_INLINE Ints minimum(Ints a, Ints b) {
  return reinterpret_cast<Ints>(AF_NATIVE(min_epi32)(reinterpret_cast<IntegerRegister>(a),
                                                     reinterpret_cast<IntegerRegister>(b)));
}
AF_KERNEL_INLINE Ints maximum(Ints a, Ints b) {
  return reinterpret_cast<Ints>(AF_NATIVE(max_epi32)(reinterpret_cast<IntegerRegister>(a),
                                                     reinterpret_cast<IntegerRegister>(b)));
}
/// a > b ? a : b per lane.
AF_KERNEL_INLINE Floats maximum(Floats a, Floats b) {
  return AF_NATIVE(max_ps)(a, b);
}

/// base[offset] per lane.
AF_KERNEL_INLINE Floats gather(const float* base, Ints offset) {
#if AF_VECTOR_BITS == 512
  return _mm512_i32gather_ps(reinterpret_cast<__m512i>(offset), base, 4);
#elif AF_VECTOR_BITS == 256
  return _mm256_i32gather_ps(base, reinterpret_cast<__m256i>(offset), 4);
#else
  return Floats{base[offset[0]], base[offset[1]], base[offset[2]], base[offset[3]]};
#endif
}

/// Two neighbouring 16-bit elements, base[offset] in the low and base[offset + 1] in the high half
/// of each lane.
AF_KERNEL_INLINE Ints gather_pairs(const uint16_t* base, Ints offset) {
#if AF_VECTOR_BITS == 512
  return reinterpret_cast<Ints>(_mm512_i32gather_epi32(reinterpret_cast<__m512i>(offset), base, 2));
#elif AF_VECTOR_BITS == 256
  return reinterpret_cast<Ints>(_mm256_i32gather_epi32(
      reinterpret_cast<const int*>(base), reinterpret_cast<__m256i>(offset), 2));
#else
  Ints pairs;
  for (int lane = 0; lane < kLanes; ++lane) {
    int32_t pair = 0;
    memcpy(&pair, base + offset[lane], sizeof(pair));
    pairs[lane] = pair;
  }
  return pairs;
#endif
}

/// The upper 16 bits of each lane, without sign.
AF_KERNEL_INLINE Ints upper_halves(Ints pairs) {
  using UnsignedInts = uint32_t __attribute__((vector_size(AF_VECTOR_BITS / 8)));
  return reinterpret_cast<Ints>(reinterpret_cast<UnsignedInts>(pairs) >> 16);
}

/// True when any lane of a comparison's result is set.
AF_KERNEL_INLINE bool any(Ints mask) {
#if AF_VECTOR_BITS == 512
  return _mm512_movepi32_mask(reinterpret_cast<__m512i>(mask)) != 0;
#elif AF_VECTOR_BITS == 256
  return _mm256_movemask_ps(reinterpret_cast<__m256>(mask)) != 0;
#else
  return _mm_movemask_ps(reinterpret_cast<__m128>(mask)) != 0;
#endif
}

#if AF_VECTOR_BITS >= 256
/// True when any lane has any of the bits set.
AF_KERNEL_INLINE bool any_bit(Ints value, int32_t bits) {
#if AF_VECTOR_BITS == 512
  return _mm512_test_epi32_mask(reinterpret_cast<__m512i>(value), _mm512_set1_epi32(bits)) != 0;
#else
  return _mm256_testz_si256(reinterpret_cast<__m256i>(value), _mm256_set1_epi32(bits)) == 0;
#endif
}

/// window[index] per lane, index in 0 ... kLanes - 1.
AF_KERNEL_INLINE Floats pick(Floats window, Ints index) {
#if AF_VECTOR_BITS == 512
  return _mm512_permutexvar_ps(reinterpret_cast<__m512i>(index), window);
#else
  return _mm256_permutevar8x32_ps(window, reinterpret_cast<__m256i>(index));
#endif
}
AF_KERNEL_INLINE Ints pick(Ints window, Ints index) {
#if AF_VECTOR_BITS == 512
  return reinterpret_cast<Ints>(_mm512_permutexvar_epi32(reinterpret_cast<__m512i>(index),
                                                         reinterpret_cast<__m512i>(window)));
#else
  return reinterpret_cast<Ints>(_mm256_permutevar8x32_epi32(reinterpret_cast<__m256i>(window),
                                                            reinterpret_cast<__m256i>(index)));
#endif
}
/// Of two windows, one after the other: index modulo 2 kLanes.
AF_KERNEL_INLINE Floats pick(Floats low, Floats high, Ints index) {
#if AF_VECTOR_BITS == 512
  return _mm512_permutex2var_ps(low, reinterpret_cast<__m512i>(index), high);
#else
  // A lane's bit 3 becomes its sign.
  return _mm256_blendv_ps(
      pick(low, index), pick(high, index), reinterpret_cast<__m256>(index << 28));
#endif
}
AF_KERNEL_INLINE Ints pick(Ints low, Ints high, Ints index) {
  return reinterpret_cast<Ints>(
      pick(reinterpret_cast<Floats>(low), reinterpret_cast<Floats>(high), index));
}
#endif

/// Stores a[0], b[0], a[1], b[1], ...
AF_KERNEL_INLINE void store_interleaved(float* to, Floats a, Floats b) {
#if AF_VECTOR_BITS == 512
  store(to, __builtin_shufflevector(a, b, 0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23));
  store(
      to + kLanes,
      __builtin_shufflevector(a, b, 8, 24, 9, 25, 10, 26, 11, 27, 12, 28, 13, 29, 14, 30, 15, 31));
#elif AF_VECTOR_BITS == 256
  store(to, __builtin_shufflevector(a, b, 0, 8, 1, 9, 2, 10, 3, 11));
  store(to + kLanes, __builtin_shufflevector(a, b, 4, 12, 5, 13, 6, 14, 7, 15));
#else
  store(to, __builtin_shufflevector(a, b, 0, 4, 1, 5));
  store(to + kLanes, __builtin_shufflevector(a, b, 2, 6, 3, 7));
#endif
}

#undef AF_NATIVE

}  // namespace af::AF_KERNEL_NAMESPACE::native
