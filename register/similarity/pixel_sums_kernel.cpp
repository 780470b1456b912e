// SPDX-License-Identifier: Apache-2.0
#include "register/similarity/pixel_sums_kernel.h"

#include "base/processor.h"

namespace af::registration::AF_KERNEL_NAMESPACE {

// base/processor.h puts its vectors into the same variant of namespace af.
using namespace af::AF_KERNEL_NAMESPACE::native;

namespace {

/// Lanes of a sum, the same for every vector width.
constexpr int kSumLanes = 16;
/// How many groups of this many lanes are summed in single precision before their sum moves to
/// double.
constexpr int kGroupsPerFlush = 64;
constexpr int kParts = kSumLanes / kLanes;

/// The first `count` elements, the other lanes 0.
AF_KERNEL_INLINE Floats load_some(const float* from, int32_t count) {
  if (count >= kLanes) return load(from);
  float values[kLanes] = {};
  for (int32_t i = 0; i < count; ++i) values[i] = from[i];
  return load(values);
}

AF_KERNEL_INLINE void store_some(float* to, Floats vector, int32_t count) {
  if (count >= kLanes) {
    store(to, vector);
    return;
  }
  for (int32_t i = 0; i < count; ++i) to[i] = vector[i];
}

/// Lanes below `count` are 1.
AF_KERNEL_INLINE Floats ones(int32_t count) {
  return to_float(-(lane_numbers() < splat(count)));
}

AF_KERNEL_INLINE Floats weight_of(const float* weights, int32_t at, int32_t count) {
  return weights == nullptr ? ones(count) : load_some(weights + at, count);
}

/// N sums of kSumLanes lanes each, in double precision.
template <uint32_t N>
struct LaneSums {
  double lanes[N][kSumLanes];
};

template <uint32_t N>
AF_KERNEL_INLINE void clear(LaneSums<N>& sums) {
  memset(&sums, 0, sizeof(sums));
}

/// Moves a part of the lanes to double precision.
template <uint32_t N>
AF_KERNEL_INLINE void flush(Floats (&recent)[N], int part, LaneSums<N>& sums) {
  for (uint32_t i = 0; i < N; ++i) {
    for (int lane = 0; lane < kLanes; ++lane)
      sums.lanes[i][part * kLanes + lane] += static_cast<double>(recent[i][lane]);
    recent[i] = splat(0.0f);
  }
}

template <uint32_t N>
AF_KERNEL_INLINE double total(const LaneSums<N>& sums, int i) {
  double sum = 0.0;
  for (int lane = 0; lane < kSumLanes; ++lane) sum += sums.lanes[i][lane];
  return sum;
}

/// N sums over pixels. add(at, left, recent) adds those of the kLanes pixels from `at` on, `left`
/// of which exist, to running sums. The order of additions does not depend on the vector width.
template <uint32_t N, typename Add>
AF_KERNEL_INLINE LaneSums<N> sum_pixels(int32_t count, const Add& add) {
  LaneSums<N> sums;
  clear(sums);
  constexpr int32_t kPixelsPerFlush = kGroupsPerFlush * kSumLanes;
  for (int32_t begin = 0; begin < count; begin += kPixelsPerFlush) {
    const int32_t left = count - begin;
    const int32_t end = begin + (left < kPixelsPerFlush ? left : kPixelsPerFlush);
    for (int part = 0; part < kParts; ++part) {
      Floats recent[N] = {};
      int32_t at = begin + part * kLanes;
      for (; at + kLanes <= end; at += kSumLanes) add(at, kLanes, recent);
      if (at < end) add(at, end - at, recent);
      flush(recent, part, sums);
    }
  }
  return sums;
}

constexpr int kGramSums = kGramProducts + kGramChannels + 1;

AF_KERNEL_INLINE void add_gram_vector(const GramChannels& request,
                                      int32_t at,
                                      int32_t count,
                                      Floats (&recent)[kGramSums]) {
  const Floats weight = weight_of(request.weights, at, count);
  Floats values[kGramChannels];
#pragma GCC unroll 8
  for (int i = 0; i < kGramChannels; ++i)
    values[i] = load_some(request.channels[i] + at, count) - splat(request.offsets[i]);
  int sum = 0;
#pragma GCC unroll 8
  for (int i = 0; i < kGramChannels; ++i) {
    const Floats weighted = weight * values[i];
    recent[kGramProducts + i] += weighted;
#pragma GCC unroll 8
    for (int j = i; j < kGramChannels; ++j) recent[sum++] += weighted * values[j];
  }
  recent[kGramSums - 1] += weight;
}

void clear_border(float* image, int32_t width, int32_t height) {
  const int64_t last_row = static_cast<int64_t>(height - 1) * width;
  for (int32_t column = 0; column < width; ++column)
    image[column] = image[last_row + column] = 0.0f;
  for (int64_t first = 0; first <= last_row; first += width)
    image[first] = image[first + width - 1] = 0.0f;
}

}  // namespace

void add_gram(const GramChannels& request, const PixelBlock& block, GramSums& result) {
  LaneSums<kGramSums> sums;
  clear(sums);
  Floats recent[kParts][kGramSums] = {};
  int groups = 0;
  const auto flush_all = [&] {
    for (int part = 0; part < kParts; ++part) flush(recent[part], part, sums);
    groups = 0;
  };
  for (int32_t row = 0; row < block.height; ++row)
    for (int32_t column = 0; column < block.width; column += kSumLanes) {
      for (int part = 0; part < kParts; ++part) {
        const int32_t at = column + part * kLanes;
        if (at < block.width)
          add_gram_vector(request, row * block.stride + at, block.width - at, recent[part]);
      }
      if (++groups == kGroupsPerFlush) flush_all();
    }
  flush_all();
  for (int i = 0; i < kGramProducts; ++i) result.products[i] += total(sums, i);
  for (int i = 0; i < kGramChannels; ++i) result.firsts[i] += total(sums, kGramProducts + i);
  result.weight += total(sums, kGramSums - 1);
}

CorrelationSums correlation_sums(
    const float* d, const float* x, const float* weights, float offset, int32_t count) {
  const LaneSums<3> sums = sum_pixels<3>(count, [=](int32_t at, int32_t left, Floats(&recent)[3]) {
    const Floats value = load_some(d + at, left) - splat(offset);
    const Floats weighted = weight_of(weights, at, left) * value;
    recent[0] += weighted;
    recent[1] += weighted * value;
    recent[2] += weighted * load_some(x + at, left);
  });
  return {total(sums, 0), total(sums, 1), total(sums, 2)};
}

RobustSums robust_sums(const RobustRequest& given, int32_t count) {
  const RobustRequest request = given;
  const Floats scale = splat(request.squared_scale);
  const Floats gain = splat(request.gain);
  const LaneSums<3> sums = sum_pixels<3>(count, [=](int32_t at, int32_t left, Floats(&recent)[3]) {
    const Floats x = load_some(request.x + at, left);
    const Floats d = load_some(request.d + at, left);
    const Floats weight = weight_of(request.weights, at, left);
    const Floats residual = x - gain * d;
    const Floats square = residual * residual;
    const Floats share = scale / (scale + square);
    const Floats robust = weight * share * share;
    if (request.robust_weights != nullptr) store_some(request.robust_weights + at, robust, left);
    if (request.curvature_weights != nullptr)
      store_some(
          request.curvature_weights + at, robust * (splat(4.0f) * share - splat(3.0f)), left);
    const Floats weighted = robust * d;
    recent[0] += weighted * x;
    recent[1] += weighted * d;
    recent[2] += weight * (splat(1.0f) - share);
  });
  return {total(sums, 0), total(sums, 1), total(sums, 2)};
}

PairSums pair_sums(const PairRequest& given, int32_t count) {
  const PairRequest request = given;
  const Floats scale = splat(request.squared_scale);
  const int32_t pairs = count - request.shift;
  const LaneSums<2> sums = sum_pixels<2>(pairs, [=](int32_t at, int32_t left, Floats(&recent)[2]) {
    const int32_t other = at + request.shift;
    const Floats weight =
        weight_of(request.weights, at, left) * weight_of(request.weights, other, left);
    const Floats step =
        load_some(request.difference + at, left) - load_some(request.difference + other, left);
    recent[0] += weight * (scale / (scale + step * step));
    recent[1] += weight;
  });
  return {total(sums, 0), total(sums, 1)};
}

void sobel(
    const float* image, int32_t width, int32_t height, float* along_columns, float* along_rows) {
  clear_border(along_columns, width, height);
  clear_border(along_rows, width, height);
  const Floats two = splat(2.0f);
  const Floats eighth = splat(0.125f);
  for (int32_t row = 1; row + 1 < height; ++row)
    for (int32_t column = 1; column + 1 < width; column += kLanes) {
      const int32_t left = width - 1 - column;
      const int64_t at = static_cast<int64_t>(row) * width + column;
      const float* const above = image + at - width;
      const float* const below = image + at + width;
      const Floats above_left = load_some(above - 1, left);
      const Floats above_right = load_some(above + 1, left);
      const Floats below_left = load_some(below - 1, left);
      const Floats below_right = load_some(below + 1, left);
      const Floats across = load_some(image + at + 1, left) - load_some(image + at - 1, left);
      const Floats down = load_some(below, left) - load_some(above, left);
      const Floats first = below_right - above_left;
      const Floats second = above_right - below_left;
      store_some(along_columns + at, eighth * (first + second + two * across), left);
      store_some(along_rows + at, eighth * (first - second + two * down), left);
    }
}

void count_histogram(const HistogramRequest& request, int32_t count) {
  uint32_t* const counts = request.counts;
  int32_t i = 0;
  for (; i + kLanes <= count; i += kLanes) {
    const Floats position =
        (load(request.drr + i) - splat(request.low)) * splat(request.bins_per_unit);
    // This order of arguments turns a NaN into bin 0, whose conversion would otherwise be
    // undefined.
    const Floats clamped = minimum(maximum(position, splat(0.0f)), splat(request.last_bin));
    Ints row_offsets;
    memcpy(&row_offsets, request.row_offsets + i, sizeof(row_offsets));
    int32_t cell[kLanes];
    store(cell, to_int(clamped) + row_offsets);
    // Neighbouring pixels tend to fall into the same cell. They are counted into several histograms
    // in turn, so that no increment waits for the previous one.
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
