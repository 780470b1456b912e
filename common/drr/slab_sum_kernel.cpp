// SPDX-License-Identifier: Apache-2.0
#include "drr/slab_sum_kernel.h"

#include "base/vec_native.h"

namespace af::AF_KERNEL_NAMESPACE {

namespace {

using native::Floats;
using native::Ints;
using native::kLanes;
using native::load;
using native::splat;
using native::store;

AF_NATIVE_INLINE Ints load_ints(const int32_t* from) {
  Ints vector;
  memcpy(&vector, from, sizeof(vector));
  return vector;
}

/// Sum of an image's rows by their weights, kLanes columns from c on.
AF_NATIVE_INLINE Floats weighted_rows(const float* image,
                                      int64_t stride,
                                      const float (&weights)[kSumTaps],
                                      int32_t c) {
  Floats sum = splat(0.0f);
  for (int tap = 0; tap < kSumTaps; ++tap) sum += weights[tap] * load(image + tap * stride + c);
  return sum;
}

/// The slab's images at one row of the sum.
template <bool kWithSlopes>
AF_NATIVE_INLINE void make_rows(const SlabTerm& term, const SumRow& row) {
  const int64_t stride = term.stride;
  const float* const value = term.images[0] + row.first * stride;
  for (int32_t c = 0; c < term.columns; c += kLanes) {
    store(term.rows[0] + c, weighted_rows(value, stride, row.weights, c));
    if (!kWithSlopes) continue;
    const float* const x = term.images[1] + row.first * stride;
    const float* const z = term.images[2] + row.first * stride;
    store(term.rows[1] + c, weighted_rows(x, stride, row.weights, c));
    store(term.rows[2] + c,
          weighted_rows(z, stride, row.weights, c) +
              term.drift[1] * weighted_rows(value, stride, row.slopes, c));
  }
}

/// A row's values that a tap takes for kLanes columns of the sum.
class Taps {
 public:
  AF_NATIVE_INLINE Taps make(const int32_t* first) {
    Taps taps;
    taps.base = first[0];
    taps.lane = load_ints(first) - first[0];
    // Ascending, so that the last one is furthest.
    taps.fit = first[kLanes - 1] - first[0] < 2 * kLanes;
    return taps;
  }
  AF_NATIVE_INLINE Floats take(const Taps& taps, const float* row, int tap) {
    const float* from = row + taps.base + tap;
#if AF_VECTOR_BITS >= 256
    if (taps.fit) return native::pick(load(from), load(from + kLanes), taps.lane);
#endif
    return native::gather(from, taps.lane);
  }

 private:
  int32_t base;
  Ints lane;
  bool fit;
};

AF_NATIVE_INLINE void put(const SlabTerm& term, int image, int64_t at, Floats value) {
  float* to = term.sum[image] + at;
  store(to, term.adds ? load(to) + value : value);
}

template <bool kWithSlopes>
AF_NATIVE_INLINE void add(const SlabTerm& given) {
  // A copy that no store can change.
  const SlabTerm term = given;
  for (int32_t r = 0; r < term.sum_rows; ++r) {
    make_rows<kWithSlopes>(term, term.t[r]);
    const int64_t row = static_cast<int64_t>(r) * term.sum_stride;
    for (int32_t c = 0; c < term.sum_columns; c += kLanes) {
      const Taps taps = Taps::make(term.s.first + c);
      Floats value = splat(0.0f);
      Floats x = splat(0.0f);
      Floats z = splat(0.0f);
      for (int tap = 0; tap < kSumTaps; ++tap) {
        const Floats weight = load(term.s.weights[tap] + c);
        const Floats of_row = Taps::take(taps, term.rows[0], tap);
        value += weight * of_row;
        if (!kWithSlopes) continue;
        x += weight * Taps::take(taps, term.rows[1], tap) +
             term.drift[0] * load(term.s.slopes[tap] + c) * of_row;
        z += weight * Taps::take(taps, term.rows[2], tap);
      }
      put(term, 0, row + c, value);
      if (!kWithSlopes) continue;
      put(term, 1, row + c, x);
      put(term, 2, row + c, z);
    }
  }
}

}  // namespace

void add_slab(const SlabTerm& term) {
  if (term.images[1] == nullptr)
    add<false>(term);
  else
    add<true>(term);
}

}  // namespace af::AF_KERNEL_NAMESPACE
