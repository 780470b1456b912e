// SPDX-License-Identifier: Apache-2.0
#include "drr/slab_sum_kernel.h"

#include "base/processor.h"

namespace af::AF_KERNEL_NAMESPACE {

namespace {

using native::Floats;
using native::Ints;
using native::kLanes;
using native::load;
using native::splat;
using native::store;

AF_KERNEL_INLINE Ints load_ints(const int32_t* from) {
  Ints vector;
  memcpy(&vector, from, sizeof(vector));
  return vector;
}

AF_KERNEL_INLINE Floats weighted(const Floats (&weights)[kSumTaps],
                                 const Floats (&values)[kSumTaps]) {
  Floats sum = splat(0.0f);
  for (int tap = 0; tap < kSumTaps; ++tap) sum += weights[tap] * values[tap];
  return sum;
}

/// The slab's images at row r of the sum.
template <bool kWithSlopes>
AF_KERNEL_INLINE void make_rows(const SlabTerm& term, int32_t r) {
  const int64_t stride = term.stride;
  const int64_t first = term.t.first[r] * stride;
  Floats weights[kSumTaps];
  Floats slopes[kSumTaps];
  for (int tap = 0; tap < kSumTaps; ++tap) {
    weights[tap] = splat(term.t.weights[tap][r]);
    slopes[tap] = splat(term.t.slopes[tap][r]);
  }
  Floats values[kSumTaps];
  const auto take_column = [&](int image, int32_t c) {
    for (int tap = 0; tap < kSumTaps; ++tap)
      values[tap] = load(term.images[image] + first + tap * stride + c);
  };
  for (int32_t c = 0; c < term.columns; c += kLanes) {
    take_column(0, c);
    store(term.rows[0] + c, weighted(weights, values));
    if (!kWithSlopes) continue;
    const Floats moved = term.drift[1] * weighted(slopes, values);
    take_column(1, c);
    store(term.rows[1] + c, weighted(weights, values));
    take_column(2, c);
    store(term.rows[2] + c, weighted(weights, values) + moved);
  }
}

/// Where taps find their values for kLanes columns of the sum.
struct Window {
  int32_t base;
  Ints lane;
  bool is_even;  ///< the nodes of neighbouring columns are neighbours
  bool is_near;  ///< a vector from `base` on holds all first taps
  bool fits;     ///< two vectors from `base` on hold all taps
};

AF_KERNEL_INLINE Window window_of(const int32_t* first) {
  // The first taps ascend, so the last one is furthest.
  const int32_t span = first[kLanes - 1] - first[0];
  const Ints lane = load_ints(first) - first[0];
  return {first[0],
          lane,
          span == kLanes - 1 && !native::any(lane != native::lane_numbers()),
          span < kLanes,
          span + kSumTaps <= 2 * kLanes};
}

AF_KERNEL_INLINE void take(const Window& window, const float* row, Floats (&values)[kSumTaps]) {
  const float* const from = row + window.base;
  // Nodes of a slab and of the sum are usually about as far apart.
  if (window.is_even) {
    for (int tap = 0; tap < kSumTaps; ++tap) values[tap] = load(from + tap);
    return;
  }
#if AF_VECTOR_BITS >= 256
  if (window.is_near) {
    for (int tap = 0; tap < kSumTaps; ++tap)
      values[tap] = native::pick(load(from + tap), window.lane);
    return;
  }
  if (window.fits) {
    const Floats low = load(from);
    const Floats high = load(from + kLanes);
    for (int tap = 0; tap < kSumTaps; ++tap)
      values[tap] = native::pick(low, high, window.lane + tap);
    return;
  }
#endif
  for (int tap = 0; tap < kSumTaps; ++tap) values[tap] = native::gather(from + tap, window.lane);
}

AF_KERNEL_INLINE void put(const SlabTerm& term, int image, int64_t at, Floats value) {
  float* to = term.sum[image] + at;
  store(to, term.adds ? load(to) + value : value);
}

template <bool kWithSlopes>
AF_KERNEL_INLINE void add(const SlabTerm& given) {
  // A copy, so that the compiler knows that no store changes it.
  const SlabTerm term = given;
  for (int32_t r = 0; r < term.sum_rows; ++r) {
    make_rows<kWithSlopes>(term, r);
    const int64_t row = static_cast<int64_t>(r) * term.sum_stride;
    for (int32_t c = 0; c < term.sum_columns; c += kLanes) {
      const Window window = window_of(term.s.first + c);
      Floats weights[kSumTaps];
      Floats values[kSumTaps];
      for (int tap = 0; tap < kSumTaps; ++tap) weights[tap] = load(term.s.weights[tap] + c);
      take(window, term.rows[0], values);
      put(term, 0, row + c, weighted(weights, values));
      if (!kWithSlopes) continue;
      Floats slopes[kSumTaps];
      for (int tap = 0; tap < kSumTaps; ++tap) slopes[tap] = load(term.s.slopes[tap] + c);
      Floats x = term.drift[0] * weighted(slopes, values);
      take(window, term.rows[1], values);
      x += weighted(weights, values);
      put(term, 1, row + c, x);
      take(window, term.rows[2], values);
      put(term, 2, row + c, weighted(weights, values));
    }
  }
}

}  // namespace

void place_taps(float start, float step, int32_t nodes, int32_t count, const SumTaps& taps) {
  const Floats last = splat(static_cast<float>(nodes - 1));
  for (int32_t i = 0; i < count; i += kLanes) {
    const Floats number = native::to_float(native::lane_numbers() + i);
    const Floats at = native::minimum(native::maximum(start + step * number, splat(0.0f)), last);
    const Ints lower =
        native::minimum(native::maximum(native::to_int(at) - 1, splat(0)), splat(nodes - kSumTaps));
    store(taps.first + i, lower);
    const Floats x = at - native::to_float(lower);
    const Floats a = x - 1.0f;
    const Floats b = x - 2.0f;
    const Floats c = x - 3.0f;
    constexpr float kSixth = 1.0f / 6.0f;
    store(taps.weights[0] + i, -kSixth * (a * b * c));
    store(taps.weights[1] + i, 0.5f * (x * b * c));
    store(taps.weights[2] + i, -0.5f * (x * a * c));
    store(taps.weights[3] + i, kSixth * (x * a * b));
    store(taps.slopes[0] + i, -kSixth * (a * b + a * c + b * c));
    store(taps.slopes[1] + i, 0.5f * (x * b + x * c + b * c));
    store(taps.slopes[2] + i, -0.5f * (x * a + x * c + a * c));
    store(taps.slopes[3] + i, kSixth * (x * a + x * b + a * b));
  }
}

void add_slab(const SlabTerm& term) {
  if (term.images[1] == nullptr)
    add<false>(term);
  else
    add<true>(term);
}

}  // namespace af::AF_KERNEL_NAMESPACE
