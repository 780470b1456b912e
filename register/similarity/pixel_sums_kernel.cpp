// SPDX-License-Identifier: Apache-2.0
#include "register/similarity/pixel_sums_kernel.h"

#include "base/vec16.h"

namespace af::registration::AF_KERNEL_NAMESPACE {

// base/vec16.h puts its vectors into the same variant of namespace af.
using namespace af::AF_KERNEL_NAMESPACE;

namespace {

/// Vectors that are summed in single precision before their sum goes on in double.
constexpr int kVectorsPerFlush = 64;

/// The first `count` elements, the other lanes 0.
AF_KERNEL_INLINE Floats16 load_some(const float* from, int32_t count) {
  if (count >= kLanes) return load<Floats16>(from);
  float values[kLanes] = {};
  for (int32_t i = 0; i < count; ++i) values[i] = from[i];
  return load<Floats16>(values);
}

AF_KERNEL_INLINE void store_some(float* to, Floats16 vector, int32_t count) {
  if (count >= kLanes) {
    store(to, vector);
    return;
  }
  for (int32_t i = 0; i < count; ++i) to[i] = vector[i];
}

/// N running sums per lane: single precision for a while, then double. The order of additions does
/// not depend on the vector width.
template <uint32_t N>
struct LaneSums {
  Floats16 recent[N];
  double flushed[N][kLanes];
  int vectors;
};

template <uint32_t N>
AF_KERNEL_INLINE void clear(LaneSums<N>& sums) {
  for (uint32_t i = 0; i < N; ++i) {
    sums.recent[i] = Floats16{};
    for (int lane = 0; lane < kLanes; ++lane) sums.flushed[i][lane] = 0.0;
  }
  sums.vectors = 0;
}

template <uint32_t N>
AF_KERNEL_INLINE void flush(LaneSums<N>& sums) {
  for (uint32_t i = 0; i < N; ++i) {
    for (int lane = 0; lane < kLanes; ++lane)
      sums.flushed[i][lane] += static_cast<double>(sums.recent[i][lane]);
    sums.recent[i] = Floats16{};
  }
  sums.vectors = 0;
}

template <uint32_t N>
AF_KERNEL_INLINE void end_vector(LaneSums<N>& sums) {
  if (++sums.vectors == kVectorsPerFlush) flush(sums);
}

template <uint32_t N>
AF_KERNEL_INLINE double total(const LaneSums<N>& sums, int i) {
  double sum = 0.0;
  for (int lane = 0; lane < kLanes; ++lane) sum += sums.flushed[i][lane];
  return sum;
}

/// Lanes below `count` are 1.
AF_KERNEL_INLINE Floats16 ones(int32_t count) {
  const Ints16 lane = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
  return to_float(-(lane < splat(count)));
}

AF_KERNEL_INLINE Floats16 weight_of(const float* weights, int32_t at, int32_t count) {
  return weights == nullptr ? ones(count) : load_some(weights + at, count);
}

constexpr int kGramSums = kGramProducts + kGramChannels + 1;

AF_KERNEL_INLINE void add_gram_vector(const GramChannels& request,
                                      int32_t at,
                                      int32_t count,
                                      LaneSums<kGramSums>& sums) {
  const Floats16 weight = weight_of(request.weights, at, count);
  Floats16 values[kGramChannels];
#pragma GCC unroll 8
  for (int i = 0; i < kGramChannels; ++i)
    values[i] = load_some(request.channels[i] + at, count) - splat(request.offsets[i]);
  int sum = 0;
#pragma GCC unroll 8
  for (int i = 0; i < kGramChannels; ++i) {
    const Floats16 weighted = weight * values[i];
    sums.recent[kGramProducts + i] += weighted;
#pragma GCC unroll 8
    for (int j = i; j < kGramChannels; ++j) sums.recent[sum++] += weighted * values[j];
  }
  sums.recent[kGramSums - 1] += weight;
  end_vector(sums);
}

}  // namespace

void add_gram(const GramChannels& request, const PixelBlock& block, GramSums& result) {
  LaneSums<kGramSums> sums;
  clear(sums);
  for (int32_t row = 0; row < block.height; ++row)
    for (int32_t column = 0; column < block.width; column += kLanes)
      add_gram_vector(request, row * block.stride + column, block.width - column, sums);
  flush(sums);
  for (int i = 0; i < kGramProducts; ++i) result.products[i] += total(sums, i);
  for (int i = 0; i < kGramChannels; ++i) result.firsts[i] += total(sums, kGramProducts + i);
  result.weight += total(sums, kGramSums - 1);
}

CorrelationSums correlation_sums(
    const float* d, const float* x, const float* weights, float offset, int32_t count) {
  LaneSums<3> sums;
  clear(sums);
  for (int32_t i = 0; i < count; i += kLanes) {
    const Floats16 value = load_some(d + i, count - i) - splat(offset);
    const Floats16 weighted = weight_of(weights, i, count - i) * value;
    sums.recent[0] += weighted;
    sums.recent[1] += weighted * value;
    sums.recent[2] += weighted * load_some(x + i, count - i);
    end_vector(sums);
  }
  flush(sums);
  return {total(sums, 0), total(sums, 1), total(sums, 2)};
}

RobustSums robust_sums(const RobustRequest& request, int32_t count) {
  LaneSums<3> sums;
  clear(sums);
  const Floats16 scale = splat(request.squared_scale);
  for (int32_t i = 0; i < count; i += kLanes) {
    const Floats16 x = load_some(request.x + i, count - i);
    const Floats16 d = load_some(request.d + i, count - i);
    const Floats16 weight = weight_of(request.weights, i, count - i);
    const Floats16 residual = x - splat(request.gain) * d;
    const Floats16 square = residual * residual;
    const Floats16 share = scale / (scale + square);
    const Floats16 robust = weight * share * share;
    if (request.robust_weights != nullptr)
      store_some(request.robust_weights + i, robust, count - i);
    const Floats16 weighted = robust * d;
    sums.recent[0] += weighted * x;
    sums.recent[1] += weighted * d;
    sums.recent[2] += weight * (splat(1.0f) - share);
    end_vector(sums);
  }
  flush(sums);
  return {total(sums, 0), total(sums, 1), total(sums, 2)};
}

PairSums pair_sums(const PairRequest& request, int32_t count) {
  LaneSums<2> sums;
  clear(sums);
  const Floats16 scale = splat(request.squared_scale);
  for (int32_t i = 0; i + request.shift < count; i += kLanes) {
    const int32_t left = count - request.shift - i;
    const int32_t other = i + request.shift;
    const Floats16 weight =
        weight_of(request.weights, i, left) * weight_of(request.weights, other, left);
    const Floats16 step =
        load_some(request.difference + i, left) - load_some(request.difference + other, left);
    sums.recent[0] += weight * (scale / (scale + step * step));
    sums.recent[1] += weight;
    end_vector(sums);
  }
  flush(sums);
  return {total(sums, 0), total(sums, 1)};
}

void sobel(
    const float* image, int32_t width, int32_t height, float* along_columns, float* along_rows) {
  const int64_t pixels = static_cast<int64_t>(width) * height;
  for (int64_t i = 0; i < pixels; ++i) along_columns[i] = along_rows[i] = 0.0f;
  const Floats16 two = splat(2.0f);
  const Floats16 eighth = splat(0.125f);
  for (int32_t row = 1; row + 1 < height; ++row)
    for (int32_t column = 1; column + 1 < width; column += kLanes) {
      const int32_t left = width - 1 - column;
      const int64_t at = static_cast<int64_t>(row) * width + column;
      const float* const above = image + at - width;
      const float* const below = image + at + width;
      const Floats16 above_left = load_some(above - 1, left);
      const Floats16 above_right = load_some(above + 1, left);
      const Floats16 below_left = load_some(below - 1, left);
      const Floats16 below_right = load_some(below + 1, left);
      const Floats16 across = load_some(image + at + 1, left) - load_some(image + at - 1, left);
      const Floats16 down = load_some(below, left) - load_some(above, left);
      const Floats16 first = below_right - above_left;
      const Floats16 second = above_right - below_left;
      store_some(along_columns + at, eighth * (first + second + two * across), left);
      store_some(along_rows + at, eighth * (first - second + two * down), left);
    }
}

void count_histogram(const HistogramRequest& request, int32_t count) {
  uint32_t* const counts = request.counts;
  int32_t i = 0;
  for (; i + kLanes <= count; i += kLanes) {
    const Floats16 position =
        (load<Floats16>(request.drr + i) - splat(request.low)) * splat(request.bins_per_unit);
    // In this order of arguments a NaN becomes bin 0 instead of an undefined conversion.
    const Floats16 clamped = minimum(maximum(position, splat(0.0f)), splat(request.last_bin));
    const Ints16 cells = to_int(clamped) + load<Ints16>(request.row_offsets + i);
    int32_t cell[kLanes];
    store(cell, cells);
    // Neighbouring pixels tend to fall into the same cell. They are counted into several histograms
    // in turn, so that no increment waits for the one before it.
#pragma GCC unroll 16
    for (int lane = 0; lane < kLanes; ++lane)
      ++counts[cell[lane] + lane % kHistogramCopies * request.cells];
  }
  for (; i < count; ++i) {
    float position = (request.drr[i] - request.low) * request.bins_per_unit;
    position = position > 0.0f ? position : 0.0f;
    position = position < request.last_bin ? position : request.last_bin;
    ++counts[static_cast<int32_t>(request.row_offsets[i]) + static_cast<int32_t>(position)];
  }
}

}  // namespace af::registration::AF_KERNEL_NAMESPACE
