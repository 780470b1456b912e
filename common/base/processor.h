// SPDX-License-Identifier: Apache-2.0
// All that names instructions of one kind of processor (x86-64). Another kind needs only another
// version of this file, and the widths of vector_width.cpp and af_add_kernel().
//
// In kernels (af_add_kernel, which sets AF_VECTOR_BITS) it provides vectors by compiler extensions.
// They have 16 lanes, which are one register of 512 bits, two of 256, or four of 128. Those in
// namespace native have the lanes of one register. Operations are per lane and never fused, so
// every width gives identical bits.
#pragma once

#include <immintrin.h>
#include <stdint.h>
#include <string.h>

#include "base/kernel_inline.h"

namespace af::processor {

/// CRC-32C of eight more bytes, and of one (SSE4.2: part of the x86-64-v2 baseline).
AF_KERNEL_INLINE uint64_t crc32c_of_word(uint64_t crc, uint64_t word) {
  return _mm_crc32_u64(crc, word);
}
AF_KERNEL_INLINE uint32_t crc32c_of_byte(uint32_t crc, uint8_t byte) {
  return _mm_crc32_u8(crc, byte);
}

/// For a loop that waits for another thread.
AF_KERNEL_INLINE void pause() {
  _mm_pause();
}

}  // namespace af::processor

#ifdef AF_VECTOR_BITS
namespace af::AF_KERNEL_NAMESPACE {

// The registers of a width, and its intrinsics.
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

/// Vectors of 16 lanes for any width.
namespace lanes16 {

inline constexpr int kLanes = 16;

using Floats16 = float __attribute__((vector_size(64)));
using Ints16 = int32_t __attribute__((vector_size(64)));

AF_KERNEL_INLINE Floats16 splat(float value) {
  return value - Floats16{};
}

template <typename Vector, typename Element>
AF_KERNEL_INLINE Vector load(const Element* from) {
  static_assert(sizeof(Vector) == 64 && sizeof(Vector{}[0]) == sizeof(Element));
  Vector vector;
  memcpy(&vector, from, sizeof(vector));
  return vector;
}

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

/// a b + sum per lane, rounded once where the width has such an instruction. Only for code whose
/// bits do not matter.
AF_KERNEL_INLINE Floats16 multiply_add(Floats16 a, Floats16 b, Floats16 sum) {
#if AF_VECTOR_BITS == 512
  __m512 parts[3];
  memcpy(&parts[0], &a, sizeof(a));
  memcpy(&parts[1], &b, sizeof(b));
  memcpy(&parts[2], &sum, sizeof(sum));
  parts[2] = _mm512_fmadd_ps(parts[0], parts[1], parts[2]);
  memcpy(&sum, &parts[2], sizeof(sum));
  return sum;
#else
  return sum + a * b;
#endif
}

}  // namespace lanes16

/// Vectors of one register, for code whose lanes are independent. GCC keeps vectors of several
/// registers in memory.
namespace native {

inline constexpr int kLanes = AF_VECTOR_BITS / 32;

using Floats = float __attribute__((vector_size(AF_VECTOR_BITS / 8)));
using Ints = int32_t __attribute__((vector_size(AF_VECTOR_BITS / 8)));
using Doubles = double __attribute__((vector_size(AF_VECTOR_BITS / 8)));

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

// Registers of the intrinsics are vector types of the same size and convert by a cast.
using Register = IntegerRegister;

#define AF_REGISTER_OPERATION(name, operation)             \
  AF_KERNEL_INLINE Register name(Register a, Register b) { \
    return AF_INTRINSIC(operation)(a, b);                  \
  }

/// Wrapping sums and differences of 16-bit lanes; products as fractions of 2^15, rounded to
/// nearest.
AF_REGISTER_OPERATION(add_shorts, add_epi16)
AF_REGISTER_OPERATION(subtract_shorts, sub_epi16)
AF_REGISTER_OPERATION(multiply_rounded, mulhrs_epi16)
AF_REGISTER_OPERATION(add_ints, add_epi32)
/// Products of 16-bit lanes, summed by twos in 32-bit lanes.
AF_REGISTER_OPERATION(multiply_add_pairs, madd_epi16)
/// Within each group of 128 bits: a[0], b[0], a[1], b[1], ... of its lower or upper half.
AF_REGISTER_OPERATION(interleave_low_16, unpacklo_epi16)
AF_REGISTER_OPERATION(interleave_high_16, unpackhi_epi16)
AF_REGISTER_OPERATION(interleave_low_32, unpacklo_epi32)
AF_REGISTER_OPERATION(interleave_high_32, unpackhi_epi32)
AF_REGISTER_OPERATION(interleave_low_64, unpacklo_epi64)
AF_REGISTER_OPERATION(interleave_high_64, unpackhi_epi64)
#undef AF_REGISTER_OPERATION

AF_KERNEL_INLINE Register splat_short(int16_t value) {
  return AF_INTRINSIC(set1_epi16)(value);
}
AF_KERNEL_INLINE Register splat_int(int32_t value) {
  return AF_INTRINSIC(set1_epi32)(value);
}

template <typename Element>
AF_KERNEL_INLINE Register load_register(const Element* from) {
  Register loaded;
  memcpy(&loaded, from, sizeof(loaded));
  return loaded;
}

/// Stores groups of 128 bits at to, to + stride, ...
AF_KERNEL_INLINE void store_groups(int16_t* to, int stride, Register value) {
#if AF_VECTOR_BITS == 512
  const __m128i groups[] = {_mm512_extracti32x4_epi32(value, 0),
                            _mm512_extracti32x4_epi32(value, 1),
                            _mm512_extracti32x4_epi32(value, 2),
                            _mm512_extracti32x4_epi32(value, 3)};
#elif AF_VECTOR_BITS == 256
  const __m128i groups[] = {_mm256_castsi256_si128(value), _mm256_extracti128_si256(value, 1)};
#else
  const __m128i groups[] = {value};
#endif
  for (int i = 0; i < AF_VECTOR_BITS / 128; ++i)
    memcpy(to + i * stride, &groups[i], sizeof(groups[i]));
}

/// The 16 unsigned levels of a tile without its mean: differences stand 32768 higher, and sums are
/// limited to 0 ... 65535.
AF_KERNEL_INLINE void add_mean(const uint16_t* shape, uint16_t mean, uint16_t* levels) {
  const __m128i middle = _mm_set1_epi16(INT16_MIN);
  const __m128i from_middle = _mm_xor_si128(_mm_set1_epi16(static_cast<short>(mean)), middle);
  for (int i = 0; i < 2; ++i) {
    const __m128i elements = _mm_loadu_si128(reinterpret_cast<const __m128i*>(shape) + i);
    const __m128i sums = _mm_adds_epi16(_mm_xor_si128(elements, middle), from_middle);
    _mm_storeu_si128(reinterpret_cast<__m128i*>(levels) + i, _mm_xor_si128(sums, middle));
  }
}

AF_KERNEL_INLINE Floats square_root(Floats value) {
  return AF_INTRINSIC(sqrt_ps)(value);
}
AF_KERNEL_INLINE Doubles square_root(Doubles value) {
  return AF_INTRINSIC(sqrt_pd)(value);
}

/// a < b ? a : b per lane.
AF_KERNEL_INLINE Floats minimum(Floats a, Floats b) {
  return AF_INTRINSIC(min_ps)(a, b);
}
AF_KERNEL_INLINE Ints minimum(Ints a, Ints b) {
  return reinterpret_cast<Ints>(
      AF_INTRINSIC(min_epi32)(reinterpret_cast<Register>(a), reinterpret_cast<Register>(b)));
}
AF_KERNEL_INLINE Ints maximum(Ints a, Ints b) {
  return reinterpret_cast<Ints>(
      AF_INTRINSIC(max_epi32)(reinterpret_cast<Register>(a), reinterpret_cast<Register>(b)));
}
/// a > b ? a : b per lane.
AF_KERNEL_INLINE Floats maximum(Floats a, Floats b) {
  return AF_INTRINSIC(max_ps)(a, b);
}

/// Lanes as 16 bits, saturated to 0 ... 65535. Within each group of 128 bits, a's four come first,
/// then b's.
AF_KERNEL_INLINE Register pack_unsigned(Ints a, Ints b) {
  return AF_INTRINSIC(packus_epi32)(reinterpret_cast<Register>(a), reinterpret_cast<Register>(b));
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

/// One bit per lane: whether it is set in the result of a comparison.
AF_KERNEL_INLINE uint32_t bits_of(Ints mask) {
#if AF_VECTOR_BITS == 512
  return _mm512_movepi32_mask(reinterpret_cast<__m512i>(mask));
#elif AF_VECTOR_BITS == 256
  return static_cast<uint32_t>(_mm256_movemask_ps(reinterpret_cast<__m256>(mask)));
#else
  return static_cast<uint32_t>(_mm_movemask_ps(reinterpret_cast<__m128>(mask)));
#endif
}
/// True when any lane of a comparison's result is set.
AF_KERNEL_INLINE bool any(Ints mask) {
  return bits_of(mask) != 0;
}

/// Every lane's value from the lane whose number differs in bit `kStride`.
template <int kStride>
AF_KERNEL_INLINE Floats exchanged(Floats values) {
  constexpr int k = kStride;
#if AF_VECTOR_BITS == 512
  return __builtin_shufflevector(values,
                                 values,
                                 0 ^ k,
                                 1 ^ k,
                                 2 ^ k,
                                 3 ^ k,
                                 4 ^ k,
                                 5 ^ k,
                                 6 ^ k,
                                 7 ^ k,
                                 8 ^ k,
                                 9 ^ k,
                                 10 ^ k,
                                 11 ^ k,
                                 12 ^ k,
                                 13 ^ k,
                                 14 ^ k,
                                 15 ^ k);
#elif AF_VECTOR_BITS == 256
  return __builtin_shufflevector(
      values, values, 0 ^ k, 1 ^ k, 2 ^ k, 3 ^ k, 4 ^ k, 5 ^ k, 6 ^ k, 7 ^ k);
#else
  return __builtin_shufflevector(values, values, 0 ^ k, 1 ^ k, 2 ^ k, 3 ^ k);
#endif
}

/// The smallest of 16 lanes.
AF_KERNEL_INLINE float smallest(const Floats (&parts)[16 / kLanes]) {
#if AF_VECTOR_BITS == 512
  return _mm512_reduce_min_ps(parts[0]);
#else
#if AF_VECTOR_BITS == 256
  const __m256 pairs = _mm256_min_ps(parts[0], parts[1]);
  const __m128 fours = _mm_min_ps(_mm256_castps256_ps128(pairs), _mm256_extractf128_ps(pairs, 1));
#else
  const __m128 fours = _mm_min_ps(_mm_min_ps(parts[0], parts[1]), _mm_min_ps(parts[2], parts[3]));
#endif
  const __m128 twos = _mm_min_ps(fours, _mm_movehl_ps(fours, fours));
  return _mm_cvtss_f32(_mm_min_ss(twos, _mm_shuffle_ps(twos, twos, 1)));
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
/// The same in two windows, one after the other, at index modulo 2 kLanes.
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

}  // namespace native

#undef AF_INTRINSIC

}  // namespace af::AF_KERNEL_NAMESPACE
#endif
