// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdint.h>

namespace af {

/// Columns of t nodes that are cast together: one 64-byte vector of 16-bit samples.
inline constexpr int kShearColumns = 32;
/// Slices that are added per visit of an accumulator.
inline constexpr int kShearSlices = 16;

/// A row of a slice: whole vectors of kShearColumns levels from x = begin on, 0 elsewhere.
struct ShearRow {
  int64_t origin;  ///< elements from `values` to x = 0
  int32_t begin;   ///< a multiple of kShearColumns
  int32_t count;   ///< likewise
};

/// What the first pass reads from one slice for a run of t nodes. It writes [x][kShearColumns].
struct ShearColumns {
  const int16_t* values;
  ShearRow lower[kShearColumns];  ///< the rows between which each column lies
  ShearRow upper[kShearColumns];
  int16_t weight[kShearColumns];  ///< weight of the upper row, in 1/32768
  int32_t whole_begin;            ///< all these rows are stored for x in [whole_begin, whole_end)
  int32_t whole_end;
};

/// The slices of one block as one viewpoint sees them. Node i of s lies at x = (start + step * i) /
/// 256 of slice k, in grid units. x outside [low, high] / 256 means 0, and the buffer holds zeros
/// at low / 256 and high / 256.
struct ShearBlock {
  int32_t slices = 0;              ///< 1 ... kShearSlices
  float start[kShearSlices] = {};  ///< in 1/256 of the grid's spacing, plus one half to round
  float step[kShearSlices] = {};
  float low[kShearSlices] = {};
  float high[kShearSlices] = {};
  int32_t origin[kShearSlices] = {};  ///< elements from `buffer` to x = 0, which may be absent
};

/// The values that turn the accumulators of one viewpoint and a run of t nodes into samples.
struct ShearScale {
  float attenuation_per_sum;  ///< for a ray perpendicular to the planes
  float quantizer_step;
  float slope_squared_t[kShearColumns];  ///< ((t - v) / (uv_plane_y - st_plane_y))^2, as
                                         ///< accumulators are ordered
};

/// A row of trilinear samples of the CT: sample i at start + i * step, in voxel indices.
struct RowToResample {
  float start[3];
  float step[3];
  int32_t first;  ///< the first i
  int32_t count;
  float scale;
};

/// Voxels of a bordered volume, i fastest.
struct VoxelsToResample {
  const uint16_t* voxels;
  int32_t size[3];
};

namespace shear_warp {

/// out[n] = round(scale * trilinear sample first + n), exactly 0 outside the volume. Writes whole
/// vectors of 16.
using ResampleRow = void (*)(const VoxelsToResample& volume,
                             const RowToResample& row,
                             int16_t* out);

/// First pass: buffer[x - first_x][j] = slice interpolated in z, for x in [first_x, first_x +
/// x_count). Both are multiples of kShearColumns.
using InterpolateColumns = void (*)(const ShearColumns& columns,
                                    int32_t first_x,
                                    int32_t x_count,
                                    int16_t* buffer);

/// Second pass: adds 256 times the sum over the block's slices, interpolated in x, to the
/// accumulators of nodes [first_node, end_node). `sums_of_first_node` is the first node's; there
/// are kShearColumns sums per node.
using AccumulateNodes = void (*)(const int16_t* buffer,
                                 const ShearBlock& block,
                                 int32_t first_node,
                                 int32_t end_node,
                                 int32_t* sums_of_first_node);

/// Samples of one node s and a run of t nodes from their accumulators.
using QuantizeNode = void (*)(const int32_t* sums,
                              const ShearScale& scale,
                              float slope_squared_s,
                              uint16_t* samples);

}  // namespace shear_warp

#define AF_DECLARE_SHEAR_WARP_KERNELS(name_space)                                            \
  namespace name_space {                                                                     \
  void resample_row(const VoxelsToResample& volume, const RowToResample& row, int16_t* out); \
  void interpolate_columns(const ShearColumns& columns,                                      \
                           int32_t first_x,                                                  \
                           int32_t x_count,                                                  \
                           int16_t* buffer);                                                 \
  void accumulate_nodes(const int16_t* buffer,                                               \
                        const ShearBlock& block,                                             \
                        int32_t first_node,                                                  \
                        int32_t end_node,                                                    \
                        int32_t* sums);                                                      \
  void quantize_node(const int32_t* sums,                                                    \
                     const ShearScale& scale,                                                \
                     float slope_squared_s,                                                  \
                     uint16_t* samples);                                                     \
  }
AF_DECLARE_SHEAR_WARP_KERNELS(kernels_128)
AF_DECLARE_SHEAR_WARP_KERNELS(kernels_256)
AF_DECLARE_SHEAR_WARP_KERNELS(kernels_512)
#undef AF_DECLARE_SHEAR_WARP_KERNELS

}  // namespace af
