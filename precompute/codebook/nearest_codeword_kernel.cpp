// SPDX-License-Identifier: Apache-2.0
// Exact nearest codeword (see nearest_codeword.h). Compiled once per vector width.
#include "precompute/codebook/nearest_codeword_kernel.h"

#include "base/processor.h"

namespace af::AF_KERNEL_NAMESPACE {

namespace {

/// Sixteen lanes in the registers of one width, because GCC keeps vectors of several registers in
/// memory.
struct Lanes {
  native::Floats part[16 / native::kLanes];
};
constexpr int kParts = 16 / native::kLanes;

/// One bit per lane: whether it is no greater than a limit.
AF_KERNEL_INLINE uint32_t bits_within(const Lanes& lanes, float limit) {
  uint32_t bits = 0;
  for (int i = 0; i < kParts; ++i)
    bits |= native::bits_of(lanes.part[i] <= native::splat(limit)) << (i * native::kLanes);
  return bits;
}

AF_KERNEL_INLINE void set_lane(Lanes& lanes, uint32_t lane, float value) {
  for (int i = 0; i < kParts; ++i) {
    const native::Ints number = native::lane_numbers() + i * native::kLanes;
    lanes.part[i] =
        number == native::splat(static_cast<int32_t>(lane)) ? native::splat(value) : lanes.part[i];
  }
}

/// The result is exact: 16 squares below 2^32 each.
AF_KERNEL_INLINE uint64_t squared_error(const uint16_t* a, const uint16_t* b) {
  uint64_t sum = 0;
  for (int i = 0; i < 16; ++i) {
    const int32_t difference = static_cast<int32_t>(a[i]) - static_cast<int32_t>(b[i]);
    const uint32_t magnitude = static_cast<uint32_t>(difference < 0 ? -difference : difference);
    sum += static_cast<uint64_t>(magnitude * magnitude);
  }
  return sum;
}

/// Sums of lanes whose numbers differ in bit `kStride`. Lanes that have the bit get differences.
template <int kStride>
AF_KERNEL_INLINE void butterfly(Lanes& values) {
  if constexpr (kStride >= native::kLanes) {
    constexpr int kApart = kStride / native::kLanes;
    for (int i = 0; i < kParts; ++i) {
      if ((i & kApart) != 0) continue;
      const native::Floats lower = values.part[i];
      values.part[i] += values.part[i + kApart];
      values.part[i + kApart] = lower - values.part[i + kApart];
    }
  } else {
    const auto is_upper = (native::lane_numbers() & kStride) != 0;
    for (native::Floats& part : values.part) {
      const native::Floats other = native::exchanged<kStride>(part);
      part = is_upper ? other - part : part + other;
    }
  }
}

/// 4-D Hadamard transform of a tile, with its coefficients in the stated order. They are integers
/// below 2^21, and so exact as floats.
template <const uint32_t (&kOrder)[16]>
AF_KERNEL_INLINE void hadamard(const uint16_t* tile, float* coefficients) {
  Lanes values;
  for (int i = 0; i < kParts; ++i) values.part[i] = native::load(tile + i * native::kLanes);
  butterfly<8>(values);
  butterfly<4>(values);
  butterfly<2>(values);
  butterfly<1>(values);
  float in_turn[16];
  memcpy(in_turn, &values, sizeof(in_turn));
  for (int i = 0; i < 16; ++i) coefficients[i] = in_turn[kOrder[i]];
}

/// The best codeword of one tile so far, and the bound that a better one must meet.
struct Best {
  uint64_t squared_error;
  uint32_t index;
  float limit;
};

/// A sum of squares of exact differences of integers is exact as a float while it stays below 2^24,
/// in any order of summation.
constexpr float kExactBelow = 0x1.0p24f;
/// Greater than any sum of a codeword, and less than those of the padding and of the guards.
constexpr float kNoLimit = 1e30f;
constexpr Best kNothing{~uint64_t{0}, ~uint32_t{0}, kNoLimit};

AF_KERNEL_INLINE float limit_of(uint64_t error) {
  // The transform scales squared distances by 16. A float sum of 16 squares of exact differences
  // errs by less than 17 * 2^-24 of itself, and 2^-18 = 64 * 2^-24 covers that and this product.
  return static_cast<float>(16 * error) * (1.0f + 0x1.0p-18f);
}

AF_KERNEL_INLINE Best guessed(const CodewordBlocks& blocks, const uint16_t* tile, uint32_t index) {
  const uint64_t error = squared_error(tile, blocks.codewords + static_cast<size_t>(index) * 16);
  return {error, index, limit_of(error)};
}

/// Offers a candidate. Ties take the lowest index.
AF_KERNEL_INLINE void offer(Best& best, uint64_t error, uint32_t candidate) {
  if (error > best.squared_error || (error == best.squared_error && candidate >= best.index))
    return;
  best = {error, candidate, limit_of(error)};
}

AF_KERNEL_INLINE void add_squared_difference(Lanes& sum, float coefficient, const float* lanes) {
  for (int i = 0; i < kParts; ++i) {
    const native::Floats difference =
        native::splat(coefficient) - native::load(lanes + i * native::kLanes);
    sum.part[i] += difference * difference;
  }
}

/// Offers the codewords of a block whose sums are within the limit, the nearest first. If sums are
/// exact, no other is needed; otherwise integers decide.
AF_KERNEL_INLINE void offer_lanes(
    const CodewordBlocks& blocks, uint32_t block, const uint16_t* tile, Lanes sums, Best& best) {
  while (bits_within(sums, best.limit) != 0) {
    const float nearest = native::smallest(sums.part);
    const auto lane = static_cast<uint32_t>(__builtin_ctz(bits_within(sums, nearest)));
    const uint32_t candidate = blocks.indices[block * 16 + lane];
    const uint64_t error =
        nearest < kExactBelow
            ? static_cast<uint64_t>(nearest) / 16
            : squared_error(tile, blocks.codewords + static_cast<size_t>(candidate) * 16);
    offer(best, error, candidate);
    if (nearest < kExactBelow) return;
    set_lane(sums, lane, kNoLimit);
  }
}

/// Compares a tile with the 16 codewords of one block. Gives up after five coefficients when all
/// are too far.
AF_KERNEL_INLINE void search_block(const CodewordBlocks& blocks,
                                   uint32_t block,
                                   const uint16_t* tile,
                                   const float* coefficients,
                                   Best& best) {
  const float* lanes = blocks.coefficients + static_cast<size_t>(block) * 256;
  Lanes sum = {};
  for (int i = 0; i < 5; ++i) add_squared_difference(sum, coefficients[i], lanes + 16 * i);
  if (bits_within(sum, best.limit) == 0) return;
  for (int i = 5; i < 16; ++i) add_squared_difference(sum, coefficients[i], lanes + 16 * i);
  offer_lanes(blocks, block, tile, sum, best);
}

AF_KERNEL_INLINE float squared_gap(float gap) {
  return gap > 0.0f ? gap * gap : 0.0f;
}

/// Walks outwards from the tile's DC, alternating between a block above and a block below, until
/// the DC alone is too far. A branch on which is nearer would be a coin toss.
AF_KERNEL_INLINE Best search_outwards(const CodewordBlocks& blocks,
                                      const uint16_t* tile,
                                      Best best) {
  float coefficients[16];
  hadamard<kCoefficientOrder>(tile, coefficients);
  const float dc = coefficients[0];

  int64_t above = blocks.start_block[static_cast<uint32_t>(dc) >> kStartShift];
  while (blocks.high_dc[above] < dc) ++above;
  int64_t below = above - 1;
  bool go_above = true;
  bool go_below = true;
  do {
    go_above = go_above && squared_gap(blocks.low_dc[above] - dc) <= best.limit;
    if (go_above) search_block(blocks, static_cast<uint32_t>(above++), tile, coefficients, best);
    go_below = go_below && squared_gap(dc - blocks.high_dc[below]) <= best.limit;
    if (go_below) search_block(blocks, static_cast<uint32_t>(below--), tile, coefficients, best);
  } while (go_above || go_below);
  return best;
}

/// Squared distances of a tile's coefficients from those of a box's children, as far as their
/// ranges tell.
AF_KERNEL_INLINE Lanes distances(const CodewordBox& box, const float* coefficients) {
  Lanes sum = {};
  for (int i = 0; i < kBoxCoefficients; ++i) {
    const native::Floats coefficient = native::splat(coefficients[i]);
    for (int part = 0; part < kParts; ++part) {
      const int at = part * native::kLanes;
      const native::Floats gap =
          native::maximum(native::maximum(native::load(box.low[i] + at) - coefficient,
                                          coefficient - native::load(box.high[i] + at)),
                          native::splat(0.0f));
      sum.part[part] += gap * gap;
    }
  }
  return sum;
}

/// Visits the blocks of a box while they may hold a codeword as near as the best. `nearest` is the
/// nearest block. It leaves few others, which come in any order.
AF_KERNEL_INLINE void search_blocks_of_box(const CodewordBlocks& blocks,
                                           uint32_t box,
                                           const Lanes& to_blocks,
                                           uint32_t nearest,
                                           const uint16_t* tile,
                                           const float* coefficients,
                                           Best& best) {
  search_block(blocks, 16 * box + nearest, tile, coefficients, best);
  float distance[16];
  memcpy(distance, &to_blocks, sizeof(distance));
  uint32_t left = bits_within(to_blocks, best.limit) & ~(1u << nearest);
  for (; left != 0; left &= left - 1) {
    const auto lane = static_cast<uint32_t>(__builtin_ctz(left));
    if (distance[lane] <= best.limit)
      search_block(blocks, 16 * box + lane, tile, coefficients, best);
  }
}

/// Beyond any limit.
constexpr float kVisited = 3e38f;

/// Visits the nearest child of a box first, down to the blocks, and the others while they may hold
/// a codeword as near as the best.
AF_KERNEL_INLINE Best search_boxes(const CodewordBlocks& blocks, const uint16_t* tile, Best best) {
  float coefficients[16];
  hadamard<kFoldedCoefficientOrder>(tile, coefficients);
  uint32_t numbers[kMostBoxLevels] = {};
  Lanes to_children[kMostBoxLevels];
  to_children[0] = distances(blocks.boxes[0][0], coefficients);
  const int32_t last = blocks.box_levels - 1;
  for (int32_t level = 0; level >= 0;) {
    const float nearest = native::smallest(to_children[level].part);
    if (!(nearest <= best.limit)) {
      --level;
      continue;
    }
    const auto lane =
        static_cast<uint32_t>(__builtin_ctz(bits_within(to_children[level], nearest)));
    if (level == last) {
      search_blocks_of_box(
          blocks, numbers[level], to_children[level], lane, tile, coefficients, best);
      --level;
      continue;
    }
    set_lane(to_children[level], lane, kVisited);
    const uint32_t child = 16 * numbers[level] + lane;
    ++level;
    numbers[level] = child;
    to_children[level] = distances(blocks.boxes[level][child], coefficients);
  }
  return best;
}

}  // namespace

void find_nearest(const CodewordBlocks& blocks, const NearestRequest& request) {
  for (size_t i = 0; i < request.tile_count; ++i) {
    const uint16_t* tile = request.tiles + 16 * i;
    const Best guess = request.has_hints ? guessed(blocks, tile, request.nearest[i]) : kNothing;
    const Best best = blocks.box_levels > 0 ? search_boxes(blocks, tile, guess)
                                            : search_outwards(blocks, tile, guess);
    request.nearest[i] = best.index;
    request.squared_errors[i] = best.squared_error;
  }
}

}  // namespace af::AF_KERNEL_NAMESPACE
