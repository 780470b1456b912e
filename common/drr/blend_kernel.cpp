// SPDX-License-Identifier: Apache-2.0
#include "drr/blend_kernel.h"

#include "base/processor.h"

namespace af::AF_KERNEL_NAMESPACE {

namespace {

using native::Floats;
using native::kLanes;
using native::load;
using native::splat;
using native::store;

/// A register of a codeword's elements, weighted and summed over the taps.
struct Blend {
  Floats value, u_slope, v_slope;
};

/// Elements first ... first + kLanes - 1 of the tile with this index.
template <bool kHasMeans>
AF_KERNEL_INLINE Floats elements_of(const TileStrip& strip, const uint16_t* index, int first) {
  const int64_t at = int64_t{16} * *index + first;
  if constexpr (kHasMeans)
    return native::load_with_mean(strip.shapes + at, index[strip.mean_offset]);
  else
    return load(strip.codewords + at);
}

/// Elements first ... first + kLanes - 1 of the tiles at d.
template <bool kWithSlopes, bool kHasMeans>
AF_KERNEL_INLINE Blend blend_elements(const TileStrip& strip, int32_t d, int first) {
  Blend sum{splat(0.0f), splat(0.0f), splat(0.0f)};
  const TileTap* const v_begin = strip.v_taps + strip.v_begin[d];
  const TileTap* const v_end = strip.v_taps + strip.v_begin[d + 1];
  for (int32_t a = 0; a < strip.u_count; ++a) {
    const TileTap& u = strip.u_taps[a];
    Floats over_v = splat(0.0f);
    Floats slope_over_v = splat(0.0f);
    for (const TileTap* v = v_begin; v != v_end; ++v) {
      const Floats elements =
          elements_of<kHasMeans>(strip, strip.indices + u.offset + v->offset + d, first);
      over_v += elements * load(v->weights + first);
      if (kWithSlopes) slope_over_v += elements * load(v->slopes + first);
    }
    sum.value += over_v * load(u.weights + first);
    if (!kWithSlopes) continue;
    sum.u_slope += over_v * load(u.slopes + first);
    sum.v_slope += slope_over_v * load(u.weights + first);
  }
  return sum;
}

using F8 = float __attribute__((vector_size(32)));
using F4 = float __attribute__((vector_size(16)));

/// The four nodes of a tile, [s][t], go to two rows of the image.
AF_KERNEL_INLINE void store_nodes(F4 nodes, float* image, int64_t stride) {
  const F4 rows = __builtin_shufflevector(nodes, nodes, 0, 2, 1, 3);
  float values[4];
  memcpy(values, &rows, sizeof(values));
  memcpy(image, values, 2 * sizeof(float));
  memcpy(image + stride, values + 2, 2 * sizeof(float));
}

// The sum over the four viewpoints of a tile is always in the order (0 + 2) + (1 + 3), so that
// every vector width gives the same bits.
#if AF_VECTOR_BITS == 512
AF_KERNEL_INLINE F4 sum_over_viewpoints(Floats elements) {
  const F8 pairs = __builtin_shufflevector(elements, elements, 0, 1, 2, 3, 4, 5, 6, 7) +
                   __builtin_shufflevector(elements, elements, 8, 9, 10, 11, 12, 13, 14, 15);
  return __builtin_shufflevector(pairs, pairs, 0, 1, 2, 3) +
         __builtin_shufflevector(pairs, pairs, 4, 5, 6, 7);
}
#elif AF_VECTOR_BITS == 256
AF_KERNEL_INLINE F4 sum_over_viewpoints(F8 pairs) {
  return __builtin_shufflevector(pairs, pairs, 0, 1, 2, 3) +
         __builtin_shufflevector(pairs, pairs, 4, 5, 6, 7);
}
#endif

template <bool kWithSlopes, bool kHasMeans>
AF_KERNEL_INLINE void blend_tile(const TileStrip& strip, int32_t d) {
#if AF_VECTOR_BITS == 512
  const Blend blend = blend_elements<kWithSlopes, kHasMeans>(strip, d, 0);
  const F4 value = sum_over_viewpoints(blend.value);
  const F4 u_slope = sum_over_viewpoints(blend.u_slope);
  const F4 v_slope = sum_over_viewpoints(blend.v_slope);
#elif AF_VECTOR_BITS == 256
  const Blend low = blend_elements<kWithSlopes, kHasMeans>(strip, d, 0);
  const Blend high = blend_elements<kWithSlopes, kHasMeans>(strip, d, 8);
  const F4 value = sum_over_viewpoints(low.value + high.value);
  const F4 u_slope = sum_over_viewpoints(low.u_slope + high.u_slope);
  const F4 v_slope = sum_over_viewpoints(low.v_slope + high.v_slope);
#else
  const Blend q0 = blend_elements<kWithSlopes, kHasMeans>(strip, d, 0);
  const Blend q1 = blend_elements<kWithSlopes, kHasMeans>(strip, d, 4);
  const Blend q2 = blend_elements<kWithSlopes, kHasMeans>(strip, d, 8);
  const Blend q3 = blend_elements<kWithSlopes, kHasMeans>(strip, d, 12);
  const F4 value = (q0.value + q2.value) + (q1.value + q3.value);
  const F4 u_slope = (q0.u_slope + q2.u_slope) + (q1.u_slope + q3.u_slope);
  const F4 v_slope = (q0.v_slope + q2.v_slope) + (q1.v_slope + q3.v_slope);
#endif
  const int64_t at = int64_t{2} * d * strip.stride;
  store_nodes(value, strip.images[0] + at, strip.stride);
  if (!kWithSlopes) return;
  store_nodes(u_slope, strip.images[1] + at, strip.stride);
  store_nodes(v_slope, strip.images[2] + at, strip.stride);
}

template <bool kWithSlopes, bool kHasMeans>
AF_KERNEL_INLINE void blend_strip(const TileStrip& given) {
  // A copy, so that the compiler knows that no store changes it.
  const TileStrip strip = given;
  for (int32_t d = strip.tile_begin; d < strip.tile_end; ++d)
    blend_tile<kWithSlopes, kHasMeans>(strip, d);
}

/// Blends a row of a block between two viewpoints along each axis, whose slopes are opposite. Rows
/// are blended one after another: samples of far-apart poses are not in a cache, and memory is read
/// fastest in the order of its addresses.
template <bool kWithSlopes>
AF_KERNEL_INLINE void blend_row_between_two(const SampleBlock& block, int32_t row) {
  const ViewpointTap& v = block.v_taps[row];
  const uint16_t* const samples = block.samples + row * block.t_stride;
  const int64_t at = row * block.image_stride;
  for (int32_t c = 0; c < block.columns; c += kLanes) {
    const Floats u_weights[2] = {load(block.u_weights[0] + c), load(block.u_weights[1] + c)};
    Floats over_v[2];
    Floats step_over_v[2];
    for (int a = 0; a < 2; ++a) {
      const uint16_t* const of_u = samples + a * block.u_stride + c;
      const Floats first = load(of_u);
      const Floats second = load(of_u + block.v_stride);
      over_v[a] = first * v.weights[0] + second * v.weights[1];
      step_over_v[a] = second - first;
    }
    store(block.images[0] + at + c, over_v[0] * u_weights[0] + over_v[1] * u_weights[1]);
    if (!kWithSlopes) continue;
    store(block.images[1] + at + c, (over_v[1] - over_v[0]) * load(block.u_slopes[1] + c));
    store(block.images[2] + at + c,
          (step_over_v[0] * u_weights[0] + step_over_v[1] * u_weights[1]) * v.slopes[1]);
  }
}

/// Blends kLanes columns of a block from column c on.
template <bool kWithSlopes, int kTaps>
AF_KERNEL_INLINE void blend_columns(const SampleBlock& block, int32_t c) {
  Floats u_weights[kMostTaps];
  Floats u_slopes[kMostTaps];
  for (int a = 0; a < kTaps; ++a) {
    u_weights[a] = load(block.u_weights[a] + c);
    u_slopes[a] = load(block.u_slopes[a] + c);
  }
  for (int32_t row = 0; row < block.rows; ++row) {
    const uint16_t* const samples = block.samples + row * block.t_stride + c;
    const ViewpointTap& v = block.v_taps[row];
    Floats value = splat(0.0f);
    Floats u_slope = splat(0.0f);
    Floats v_slope = splat(0.0f);
    for (int a = 0; a < kTaps; ++a) {
      Floats over_v = splat(0.0f);
      Floats slope_over_v = splat(0.0f);
      for (int b = 0; b < kTaps; ++b) {
        const Floats sample = load(samples + a * block.u_stride + b * block.v_stride);
        over_v += sample * v.weights[b];
        if (kWithSlopes) slope_over_v += sample * v.slopes[b];
      }
      value += over_v * u_weights[a];
      if (!kWithSlopes) continue;
      u_slope += over_v * u_slopes[a];
      v_slope += slope_over_v * u_weights[a];
    }
    const int64_t at = row * block.image_stride + c;
    store(block.images[0] + at, value);
    if (!kWithSlopes) continue;
    store(block.images[1] + at, u_slope);
    store(block.images[2] + at, v_slope);
  }
}

template <bool kWithSlopes, int kTaps>
AF_KERNEL_INLINE void blend_block(const SampleBlock& given) {
  // A copy, so that the compiler knows that no store changes it.
  const SampleBlock block = given;
  if constexpr (kTaps == 2)
    for (int32_t row = 0; row < block.rows; ++row) blend_row_between_two<kWithSlopes>(block, row);
  else
    for (int32_t c = 0; c < block.columns; c += kLanes) blend_columns<kWithSlopes, kTaps>(block, c);
}

}  // namespace

void blend_tiles(const TileStrip& strip) {
  const bool has_slopes = strip.images[1] != nullptr;
  if (strip.shapes == nullptr)
    has_slopes ? blend_strip<true, false>(strip) : blend_strip<false, false>(strip);
  else
    has_slopes ? blend_strip<true, true>(strip) : blend_strip<false, true>(strip);
}

void blend_samples(const SampleBlock& block) {
  const bool has_slopes = block.images[1] != nullptr;
  if (block.taps == 2)
    has_slopes ? blend_block<true, 2>(block) : blend_block<false, 2>(block);
  else
    has_slopes ? blend_block<true, 4>(block) : blend_block<false, 4>(block);
}

}  // namespace af::AF_KERNEL_NAMESPACE
