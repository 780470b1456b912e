// SPDX-License-Identifier: Apache-2.0
#include "precompute/casting/shear_warp_kernel.h"

#include "base/processor.h"

namespace af::AF_KERNEL_NAMESPACE {

namespace {

AF_KERNEL_INLINE native::Floats mix(native::Floats a, native::Floats b, native::Floats weight) {
  return a + weight * (b - a);
}

/// The cell that holds a position along one axis of `size` voxels, and the weight of its upper end.
/// Positions beyond the border are moved onto it, where voxels are 0 and so is every interpolant.
struct Cell {
  native::Ints index;
  native::Floats weight;
};

AF_KERNEL_INLINE Cell cell_of(native::Floats position, int32_t size) {
  const native::Floats inside = native::minimum(native::maximum(position, native::splat(0.0f)),
                                                native::to_float(native::splat(size - 1)));
  const native::Ints index = native::minimum(native::to_int(inside), native::splat(size - 2));
  return {index, inside - native::to_float(index)};
}

struct Pair {
  native::Floats low;
  native::Floats high;
};

AF_KERNEL_INLINE Pair unpack(native::Ints pairs) {
  return {native::to_float(pairs & 0xFFFF), native::to_float(native::upper_halves(pairs))};
}

AF_KERNEL_INLINE native::Floats sample(const VoxelsToResample& volume,
                                       native::Floats x,
                                       native::Floats y,
                                       native::Floats z) {
  const Cell i = cell_of(x, volume.size[0]);
  const Cell j = cell_of(y, volume.size[1]);
  const Cell k = cell_of(z, volume.size[2]);
  const int32_t row_stride = volume.size[0];
  const int32_t slice_stride = volume.size[0] * volume.size[1];
  const native::Ints offset = i.index + j.index * row_stride + k.index * slice_stride;
  const uint16_t* next_slice = volume.voxels + slice_stride;
  const Pair row_00 = unpack(native::gather_pairs(volume.voxels, offset));
  const Pair row_10 = unpack(native::gather_pairs(volume.voxels + row_stride, offset));
  const Pair row_01 = unpack(native::gather_pairs(next_slice, offset));
  const Pair row_11 = unpack(native::gather_pairs(next_slice + row_stride, offset));
  const native::Floats low =
      mix(mix(row_00.low, row_10.low, j.weight), mix(row_01.low, row_11.low, j.weight), k.weight);
  const native::Floats high = mix(
      mix(row_00.high, row_10.high, j.weight), mix(row_01.high, row_11.high, j.weight), k.weight);
  return mix(low, high, i.weight);
}

constexpr int16_t kZeros[kShearColumns] = {};

/// The levels of a row from x on, a multiple of kShearColumns.
template <bool kIsStored>
AF_KERNEL_INLINE const int16_t* block_of(const int16_t* values, const ShearRow& row, int32_t x) {
  const bool is_stored =
      kIsStored || static_cast<uint32_t>(x - row.begin) < static_cast<uint32_t>(row.count);
  return is_stored ? values + (row.origin + x) : kZeros;
}

/// 16-bit lanes of one register.
constexpr int kRegisterShorts = 2 * native::kLanes;
/// Half the sums of a node. From here on are those of the last four columns of each eight.
constexpr int kHalfOfSums = kShearColumns / 2;

/// Eight columns from `group` on for the places of one register, from x + `first` on. Registers are
/// handled one by one, because GCC keeps vectors of several in memory.
template <bool kIsStored>
AF_KERNEL_INLINE void interpolate_block(
    const ShearColumns& columns, int group, int32_t x, int first, native::Register (&block)[8]) {
  for (int i = 0; i < 8; ++i) {
    const int j = group + i;
    native::Register lower;
    native::Register upper;
    memcpy(&lower, block_of<kIsStored>(columns.values, columns.lower[j], x) + first, sizeof(lower));
    memcpy(&upper, block_of<kIsStored>(columns.values, columns.upper[j], x) + first, sizeof(upper));
    block[i] = native::add_shorts(lower,
                                  native::multiply_rounded(native::subtract_shorts(upper, lower),
                                                           native::splat_short(columns.weight[j])));
  }
}

/// Transposes 8 x 8 lanes within each group, so that rows of x become rows of t.
AF_KERNEL_INLINE void transpose_groups(native::Register (&rows)[8]) {
  native::Register pairs[8];
  for (int i = 0; i < 4; ++i) {
    pairs[2 * i] = native::interleave_low_16(rows[2 * i], rows[2 * i + 1]);
    pairs[2 * i + 1] = native::interleave_high_16(rows[2 * i], rows[2 * i + 1]);
  }
  native::Register fours[8];
  for (int half = 0; half < 8; half += 4)
    for (int i = 0; i < 2; ++i) {
      fours[half + 2 * i] = native::interleave_low_32(pairs[half + i], pairs[half + i + 2]);
      fours[half + 2 * i + 1] = native::interleave_high_32(pairs[half + i], pairs[half + i + 2]);
    }
  for (int i = 0; i < 4; ++i) {
    rows[2 * i] = native::interleave_low_64(fours[i], fours[i + 4]);
    rows[2 * i + 1] = native::interleave_high_64(fours[i], fours[i + 4]);
  }
}

/// Adds all slices of one node s to the sums of the columns of one register. Within each group of
/// eight, the first four columns go to `low`, the others to `high`. Uses single registers, because
/// GCC keeps arrays and emulated vectors that are carried around a loop in memory.
AF_KERNEL_INLINE void add_slices(const int16_t* columns,
                                 const int32_t* offsets,
                                 const int32_t* weights,
                                 int32_t slices,
                                 int32_t* low,
                                 int32_t* high) {
  native::Register low_sum;
  native::Register high_sum;
  memcpy(&low_sum, low, sizeof(low_sum));
  memcpy(&high_sum, high, sizeof(high_sum));
  for (int k = 0; k < slices; ++k) {
    const int16_t* row = columns + offsets[k];
    native::Register lower;
    native::Register upper;
    memcpy(&lower, row, sizeof(lower));
    memcpy(&upper, row + kShearColumns, sizeof(upper));
    const native::Register weight = native::splat_int(weights[k]);
    low_sum = native::add_ints(
        low_sum, native::multiply_add_pairs(native::interleave_low_16(lower, upper), weight));
    high_sum = native::add_ints(
        high_sum, native::multiply_add_pairs(native::interleave_high_16(lower, upper), weight));
  }
  memcpy(low, &low_sum, sizeof(low_sum));
  memcpy(high, &high_sum, sizeof(high_sum));
}

}  // namespace

void resample_row(const VoxelsToResample& volume, const RowToResample& row, int16_t* out) {
  using native::Floats;
  Floats index = native::to_float(native::lane_numbers()) + static_cast<float>(row.first);
  const auto lanes = static_cast<float>(native::kLanes);
  for (int32_t i = 0; i < row.count; i += native::kLanes, index += lanes) {
    const Floats value = sample(volume,
                                row.start[0] + index * row.step[0],
                                row.start[1] + index * row.step[1],
                                row.start[2] + index * row.step[2]);
    int32_t levels[native::kLanes];
    native::store(levels, native::to_int(value * row.scale + 0.5f));
    for (int lane = 0; lane < native::kLanes; ++lane)
      out[i + lane] = static_cast<int16_t>(levels[lane]);
  }
}

void interpolate_columns(const ShearColumns& columns,
                         int32_t first_x,
                         int32_t x_count,
                         int16_t* buffer) {
  // Groups of columns are the outer loop. Few rows at a time are then read, each to its end, which
  // suits memory prefetchers.
  for (int group = 0; group < kShearColumns; group += 8)
    for (int32_t done = 0; done < x_count; done += kShearColumns) {
      const int32_t x = first_x + done;
      const bool is_whole = x >= columns.whole_begin && x < columns.whole_end;
      for (int first = 0; first < kShearColumns; first += kRegisterShorts) {
        native::Register block[8];
        if (is_whole)
          interpolate_block<true>(columns, group, x, first, block);
        else
          interpolate_block<false>(columns, group, x, first, block);
        transpose_groups(block);
        for (int i = 0; i < 8; ++i)
          native::store_groups(
              buffer + (done + first + i) * kShearColumns + group, 8 * kShearColumns, block[i]);
      }
    }
}

void accumulate_nodes(const int16_t* buffer,
                      const ShearBlock& block,
                      int32_t first_node,
                      int32_t end_node,
                      int32_t* sums) {
  using native::Floats;
  using native::Ints;
  int32_t offsets[kShearSlices];
  int32_t weights[kShearSlices];
  for (int32_t node = first_node; node < end_node; ++node, sums += kShearColumns) {
    for (int k = 0; k < kShearSlices; k += native::kLanes) {
      const Floats at =
          native::load(block.start + k) + native::load(block.step + k) * static_cast<float>(node);
      const Ints x = native::to_int(native::minimum(
          native::maximum(at, native::load(block.low + k)), native::load(block.high + k)));
      native::store(offsets + k, (x >> 8) * kShearColumns + native::load(block.origin + k));
      const Ints weight = x & 255;
      native::store(weights + k, (256 - weight) | (weight << 16));
    }
    // Goes through memory on purpose: loads that broadcast are cheaper than taking registers apart.
    asm volatile("" : : : "memory");
    for (int i = 0; i < kHalfOfSums; i += native::kLanes)
      add_slices(buffer + 2 * i, offsets, weights, block.slices, sums + i, sums + kHalfOfSums + i);
  }
}

void quantize_node(const int32_t* sums,
                   const ShearScale& scale,
                   float slope_squared_s,
                   uint16_t* samples) {
  using native::Floats;
  const auto levels = [&](int first) {
    const Floats slope_squared = native::load(scale.slope_squared_t + first) + slope_squared_s;
    const Floats total_attenuation = native::to_float(native::load(sums + first)) *
                                     scale.attenuation_per_sum *
                                     native::square_root(slope_squared + 1.0f);
    const Floats level = total_attenuation / scale.quantizer_step + 0.5f;
    return native::to_int(native::minimum(level, native::splat(65535.0f)));
  };
  for (int i = 0; i < kHalfOfSums; i += native::kLanes) {
    const native::Register packed = native::pack_unsigned(levels(i), levels(kHalfOfSums + i));
    memcpy(samples + 2 * i, &packed, sizeof(packed));
  }
}

}  // namespace af::AF_KERNEL_NAMESPACE
