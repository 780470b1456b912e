// SPDX-License-Identifier: Apache-2.0
// Coding of blocks of indices (see index_coding.h). Compiled once per vector width.
#include "field/index_coding_kernel.h"

#include "field/range_coder.h"
#include "field/tile_prediction.h"

namespace af::AF_KERNEL_NAMESPACE {

namespace {

/// Part of the format of files, as the numbers in the header.
constexpr float kFirstSurprise = 64.0f;
constexpr float kForgetting = 1.0f / 32.0f;
/// Least probabilities, of 65536. That of empty tiles bounds how far a block can shrink: to a
/// 704th.
constexpr uint32_t kLeastTurn = 32;
constexpr uint32_t kLeastEmpty = 1024;
constexpr uint32_t kLeastMean = 32;

constexpr int32_t kModelsOfOrder = kDistances * kWidths;
/// Where the models of a coefficient begin: those of its order, that is, how many axes it is a
/// difference along: 0, 1, more.
struct FirstModels {
  alignas(64) int32_t of[16] = {};

  constexpr FirstModels() {
    for (int j = 0; j < 16; ++j) {
      const int axes = __builtin_popcount(static_cast<unsigned>(j));
      of[j] = (axes < kOrders ? axes : kOrders - 1) * kModelsOfOrder;
    }
  }
};
constexpr FirstModels kFirstModels;

constexpr int kOctaveShift = 21;        // of a float's bits: two of the mantissa are kept
constexpr int32_t kOctavesOfOne = 508;  // 127 << 2

AF_KERNEL_INLINE int32_t quarter_octaves(float magnitude) {
  const float above_one = magnitude + 1.0f;
  int32_t bits = 0;
  memcpy(&bits, &above_one, sizeof(bits));
  return (bits >> kOctaveShift) - kOctavesOfOne;
}

AF_KERNEL_INLINE native::Ints quarter_octaves(native::Floats magnitudes) {
  const native::Floats above_one = magnitudes + 1.0f;
  return (reinterpret_cast<native::Ints>(above_one) >> kOctaveShift) - kOctavesOfOne;
}

AF_KERNEL_INLINE native::Floats magnitude(native::Floats values) {
  return reinterpret_cast<native::Floats>(reinterpret_cast<native::Ints>(values) & 0x7FFFFFFF);
}

/// Within 0 ... 15.
AF_KERNEL_INLINE native::Ints class_of(native::Ints quarters) {
  return native::minimum(native::maximum(quarters >> 1, native::Ints{}), native::splat(15));
}

/// values[index] per lane, of 16.
template <typename Vector, typename Value>
AF_KERNEL_INLINE Vector picked(const Value* values, native::Ints index) {
#if AF_VECTOR_BITS == 512
  return native::pick(native::load(values), index);
#elif AF_VECTOR_BITS == 256
  return native::pick(native::load(values), native::load(values + kLanes), index);
#else
  return Vector{values[index[0]], values[index[1]], values[index[2]], values[index[3]]};
#endif
}

/// Sums of every fourth of 16, then of these by pairs.
AF_KERNEL_INLINE float sum_of(const float* values) {
  __m128 sums = _mm_load_ps(values);
  for (int first = 4; first < 16; first += 4) sums = _mm_add_ps(sums, _mm_load_ps(values + first));
  return (sums[0] + sums[1]) + (sums[2] + sums[3]);
}

/// A block under way, and the tile that it has come to.
template <typename Coder, typename Index>
struct Lane {
  Coder coder;
  BlockMemory memory;
  Index* index;        ///< of the tile
  bool* is_exhausted;  ///< of a decoder
  int32_t u, v, s, t;
  TileNote* here;          ///< the tile's note
  const TileNote* before;  ///< that of the tile before it along u
  int32_t surprise_class;
  const int32_t* usual;     ///< errors there, in quarters of an octave
  uint32_t cluster;         ///< that the way has come to
  uint32_t within_cluster;  ///< the node there
  uint32_t number;          ///< and in the whole tree
  alignas(64) float predicted[16];
  alignas(64) int32_t models[kNodesOfCluster];  ///< of the turns at the cluster's nodes
};

AF_KERNEL_INLINE int64_t row_of(const BlockShape& shape) {
  return shape.t + 2;
}
AF_KERNEL_INLINE int64_t plane_of(const BlockShape& shape) {
  return (shape.s + 2) * row_of(shape);
}

/// Values of one row in the array: with means, a row of these follows that of the indices.
template <bool kHasMeans>
AF_KERNEL_INLINE int64_t values_of_row(const BlockShape& shape) {
  return kHasMeans ? int64_t{2} * shape.t : shape.t;
}

/// An encoder's indices stay as they are.
AF_KERNEL_INLINE void set(const uint16_t* /*index*/, uint16_t /*codeword*/) {}
AF_KERNEL_INLINE void set(uint16_t* index, uint16_t codeword) {
  *index = codeword;
}
/// The same for the mean of the tile with this index.
AF_KERNEL_INLINE void set_mean(const uint16_t*, const BlockShape&, uint16_t) {}
AF_KERNEL_INLINE void set_mean(uint16_t* index, const BlockShape& shape, uint16_t mean) {
  index[shape.t] = mean;
}

/// Points to the notes of the tile and of the one before it along u.
template <typename Coder, typename Index>
AF_KERNEL_INLINE void find_notes(Lane<Coder, Index>& lane, const BlockShape& shape) {
  const int64_t at = lane.v * plane_of(shape) + (lane.s + 1) * row_of(shape) + lane.t + 1;
  const int64_t all = shape.v * plane_of(shape);
  lane.here = lane.memory.notes + (lane.u % 2) * all + at;
  lane.before = lane.memory.notes + ((lane.u + 1) % 2) * all + at;
}

template <typename Coder, typename Index>
AF_KERNEL_INLINE void begin(Lane<Coder, Index>& lane,
                            const BlockShape& shape,
                            const BlockMemory& memory,
                            Index* indices) {
  lane.memory = memory;
  lane.index = indices;
  lane.u = lane.v = lane.s = lane.t = 0;
  find_notes(lane, shape);
}

template <bool kHasMeans, typename Coder, typename Index>
AF_KERNEL_INLINE void go_on(Lane<Coder, Index>& lane, const BlockShape& shape) {
  ++lane.index;
  ++lane.here;
  ++lane.before;
  if (++lane.t < shape.t) return;
  lane.t = 0;
  lane.index += values_of_row<kHasMeans>(shape) - shape.t;
  if (++lane.s == shape.s) {
    lane.s = 0;
    if (++lane.v == shape.v) {
      lane.v = 0;
      ++lane.u;
    }
  }
  find_notes(lane, shape);
}

/// Neighbours in the order of kPredictors.
AF_KERNEL_INLINE void find_neighbours(const TileNote* here,
                                      const TileNote* before,
                                      int64_t row,
                                      const TileNote* around[kPredictors]) {
  around[0] = before;
  around[1] = here - row;
  around[2] = here - 1;
  around[3] = here - row - 1;
  around[4] = before + row;
  around[5] = before + 1;
  around[6] = before - row;
  around[7] = before - 1;
}

/// The first occupied neighbour, or codeword 0 without one, stands in for a neighbour that is
/// missing.
AF_KERNEL_INLINE uint32_t substitute_of(const TileNote* const around[kPredictors]) {
  for (int i = 0; i < kPredictors; ++i)
    if (around[i]->state == kOccupied) return around[i]->codeword;
  return 0;
}

AF_KERNEL_INLINE PredictionInputs inputs_of(const CodewordTables& tables,
                                            const TileNote* const around[kPredictors]) {
  PredictionInputs inputs;
  bool is_whole = true;
  for (int i = 0; i < kPredictors; ++i) {
    inputs.plain[i] = tables.coefficients + 16u * uint32_t{around[i]->codeword};
    inputs.turned[i] = inputs.plain[i];
    is_whole = is_whole && around[i]->state != kMissing;
  }
  if (is_whole) [[likely]]
    return inputs;
  const float* const substitute = tables.coefficients + 16u * substitute_of(around);
  for (int i = 0; i < kPredictors; ++i)
    if (around[i]->state == kMissing) inputs.plain[i] = substitute;
  return inputs;
}

/// What a neighbour's sum of levels weighs in the prediction of a tile's.
constexpr float weight_of_sum(int neighbour) {
  int weight = 0;
  for (const Term& term : kTerms)
    if (term.neighbour == neighbour && term.turn == 0) weight += term.weights[0];
  return static_cast<float>(weight) / 64.0f;
}
constexpr float kSumWeights[kPredictors] = {weight_of_sum(0),
                                            weight_of_sum(1),
                                            weight_of_sum(2),
                                            weight_of_sum(3),
                                            weight_of_sum(4),
                                            weight_of_sum(5),
                                            weight_of_sum(6),
                                            weight_of_sum(7)};

/// The sum of a tile's levels that its neighbours' means predict.
AF_KERNEL_INLINE float expected_of_means(const BlockMemory& memory,
                                         const TileNote* const around[kPredictors]) {
  const auto sum_of = [&](const TileNote* note) { return memory.sums[note - memory.notes]; };
  float substitute = 0.0f;
  for (int i = kPredictors - 1; i >= 0; --i)
    if (around[i]->state == kOccupied) substitute = sum_of(around[i]);
  float sum = 0.0f;
  for (int i = 0; i < kPredictors; ++i)
    sum += kSumWeights[i] * (around[i]->state == kMissing ? substitute : sum_of(around[i]));
  return sum;
}

/// Of the first four neighbours.
AF_KERNEL_INLINE int32_t surprise_class_of(const TileNote* const around[kPredictors]) {
  float sum = 0.0f;
  int32_t count = 0;
  for (int i = 0; i < 4; ++i) {
    sum += around[i]->surprise;
    count += around[i]->state == kOccupied ? 1 : 0;
  }
  const float mean = count > 0 ? sum / static_cast<float>(count) : kFirstSurprise;
  const int32_t octaves = quarter_octaves(mean + 1.0f) / 4;
  return octaves < kSurpriseClasses - 1 ? octaves : kSurpriseClasses - 1;
}

AF_KERNEL_INLINE uint32_t empty_context_of(const TileNote* const around[kPredictors]) {
  uint32_t context = around[0]->state;
  context = 3 * context + around[1]->state;
  context = 3 * context + around[2]->state;
  context = 3 * context + around[4]->state;
  return 3 * context + around[5]->state;
}

AF_KERNEL_INLINE void prefetch_coefficients(const CodewordTables& tables, uint16_t codeword) {
  __builtin_prefetch(tables.coefficients + 16u * uint32_t{codeword});
}

/// Codes by how many steps a mean differs from its prediction; `difference` is an encoder's.
/// `offset`: of the prediction from its nearest step, in quarters of half a step, 0 ... 3; the
/// difference counts upwards on the side where the prediction lies.
template <typename Coder>
AF_KERNEL_INLINE int32_t
code_difference(Coder& coder, AdaptiveBit* models, int32_t offset, int32_t difference) {
  AdaptiveBit* const has_more_bits = models + 2 * kMeanOffsets;
  AdaptiveBit* const of_bits = has_more_bits + kMeanBits;
  if (!coder.template code<kLeastMean>(models[2 * offset], difference != 0)) return 0;
  const bool is_below = coder.template code<kLeastMean>(models[2 * offset + 1], difference < 0);
  const uint32_t given = static_cast<uint32_t>(is_below ? -difference : difference);
  const int32_t given_bits = 32 - __builtin_clz(given | 1u);
  int32_t bits = 1;
  while (bits < kMeanBits &&
         coder.template code<kLeastMean>(has_more_bits[bits - 1], given_bits > bits))
    ++bits;
  uint32_t magnitude = 1;
  for (int32_t left = bits - 2; left >= 0; --left) {
    // The two highest bits after the first have models for their number of bits, the rest one.
    const int32_t lower = static_cast<int32_t>(magnitude & 1u);
    AdaptiveBit& model = left == bits - 2   ? of_bits[3 * (bits - 1)]
                         : left == bits - 3 ? of_bits[3 * (bits - 1) + 1 + lower]
                                            : of_bits[0];
    const bool bit =
        coder.template code<kLeastMean>(model, (given >> static_cast<uint32_t>(left) & 1u) != 0);
    magnitude = 2 * magnitude + static_cast<uint32_t>(bit);
  }
  return is_below ? -static_cast<int32_t>(magnitude) : static_cast<int32_t>(magnitude);
}

/// Codes the mean of a tile whose levels are foretold to have this sum; returns 16 times the mean.
template <typename Coder, typename Index>
AF_KERNEL_INLINE float code_mean(Lane<Coder, Index>& lane,
                                 const CodewordTables& tables,
                                 const BlockShape& shape,
                                 float expected_sum) {
  const float sum_of_step = 16.0f * static_cast<float>(tables.mean_step);
  const float usual = lane.memory.errors[16 * lane.surprise_class];
  const int32_t spread = quarter_octaves(16.0f * (usual / sum_of_step)) >> 1;
  AdaptiveBit* const models = lane.memory.mean_models +
                              kModelsOfSpread * (spread < kMeanSpreads ? spread : kMeanSpreads - 1);
  const int32_t most = 65535 / tables.mean_step;
  const auto limited = [&](int32_t steps) { return steps < 0 ? 0 : steps > most ? most : steps; };
  // Beyond either end by some tiles' sums at most.
  const float steps = expected_sum / sum_of_step;
  // Part of the format: no other rounding will do.
  // NOLINTNEXTLINE(bugprone-incorrect-roundings)
  const int32_t expected = limited(static_cast<int32_t>(steps + 0.5f));
  const float beyond = steps - static_cast<float>(expected);
  const int32_t side = beyond < 0.0f ? -1 : 1;
  const int32_t offset = static_cast<int32_t>(8.0f * (beyond < 0.0f ? -beyond : beyond));
  const int32_t given = lane.index[shape.t] / tables.mean_step - expected;
  const int32_t coded = code_difference(
      lane.coder, models, offset < kMeanOffsets ? offset : kMeanOffsets - 1, side * given);
  // Bytes that no encoder wrote may give any difference.
  const int32_t level = limited(expected + side * coded) * tables.mean_step;
  set_mean(lane.index, shape, static_cast<uint16_t>(level));
  return 16.0f * static_cast<float>(level);
}

/// Codes empty tiles up to one that is not, predicts it, and codes its mean; false at the end of
/// the block.
template <bool kHasMeans, typename Coder, typename Index>
AF_KERNEL_INLINE bool go_to_occupied(Lane<Coder, Index>& lane,
                                     const CodewordTables& tables,
                                     const BlockShape& shape) {
  const int64_t row = row_of(shape);
  const TileNote* around[kPredictors];
  for (; lane.u < shape.u; go_on<kHasMeans>(lane, shape)) {
    find_neighbours(lane.here, lane.before, row, around);
    AdaptiveBit& model = lane.memory.empties[empty_context_of(around)];
    const bool is_empty = lane.coder.template code<kLeastEmpty>(model, *lane.index == 0);
    if (!is_empty && tables.codeword_count > 1) break;
    set(lane.index, 0);
    *lane.here = {0.0f, 0, kEmpty};
    if constexpr (kHasMeans) {
      set_mean(lane.index, shape, 0);
      lane.memory.sums[lane.here - lane.memory.notes] = 0.0f;
    }
  }
  if (lane.u >= shape.u) return false;
  // For the tiles that come next but two: the plane before is known.
  prefetch_coefficients(tables, lane.before[row + 3].codeword);
  lane.surprise_class = surprise_class_of(around);
  lane.usual = lane.memory.octaves + 16 * lane.surprise_class;
  predict_tile(inputs_of(tables, around), lane.predicted);
  if constexpr (kHasMeans) {
    const float expected_sum = lane.predicted[0] + expected_of_means(lane.memory, around);
    const float sum = code_mean(lane, tables, shape, expected_sum);
    lane.memory.sums[lane.here - lane.memory.notes] = sum;
    lane.predicted[0] = expected_sum - sum;
  }
  lane.cluster = 0;
  lane.within_cluster = tables.first_node;
  lane.number = 1;
  return true;
}

/// Models of the turns at some nodes of a cluster, as many as a vector has lanes.
AF_KERNEL_INLINE native::Ints turn_models(const NodeCluster& cluster,
                                          int first,
                                          const float* predicted,
                                          const int32_t* usual) {
  const native::Ints splits = native::load(cluster.splits + first);
  const native::Ints coefficients = splits & 15;
  const native::Floats differences =
      picked<native::Floats>(predicted, coefficients) - native::load(cluster.thresholds + first);
  const native::Ints usual_there = picked<native::Ints>(usual, coefficients);
  const native::Ints distances =
      class_of(quarter_octaves(magnitude(differences)) - usual_there + 24);
  const native::Ints widths = class_of((splits >> 4) - usual_there + 20);
  const native::Ints is_above = ~(reinterpret_cast<native::Ints>(differences) >> 31);
  const native::Ints sides = (distances ^ is_above) + kDistances / 2;
  return picked<native::Ints>(kFirstModels.of, coefficients) + sides * kWidths + widths;
}

/// Enters a cluster on the way to a codeword. Finds the models of all its turns at once, so that
/// each turn waits only for the one before it.
template <typename Coder, typename Index>
AF_KERNEL_INLINE void enter_cluster(Lane<Coder, Index>& lane, const CodewordTables& tables) {
#pragma GCC unroll 4
  for (int first = 0; first < kNodesOfCluster; first += kLanes)
    native::store(lane.models + first,
                  turn_models(tables.clusters[lane.cluster], first, lane.predicted, lane.usual));
}

/// One turn of the way from the root to a codeword; `is_upper` is an encoder's.
template <typename Coder, typename Index>
AF_KERNEL_INLINE void take_turn(Lane<Coder, Index>& lane, bool is_upper) {
  const bool bit = lane.coder.template code<kLeastTurn>(
      lane.memory.turns[lane.models[lane.within_cluster]], is_upper);
  lane.within_cluster = 2 * lane.within_cluster + static_cast<uint32_t>(bit);
  lane.number = 2 * lane.number + static_cast<uint32_t>(bit);
}

/// A way leaves a cluster for the next one.
template <typename Coder, typename Index>
AF_KERNEL_INLINE void leave_cluster(Lane<Coder, Index>& lane) {
  lane.cluster = kNodesOfCluster * lane.cluster + 1 + (lane.within_cluster - kNodesOfCluster);
  lane.within_cluster = 1;
}

/// Learns from the tile, and notes it.
template <bool kHasMeans, typename Coder, typename Index>
AF_KERNEL_INLINE void finish_tile(Lane<Coder, Index>& lane,
                                  const CodewordTables& tables,
                                  const BlockShape& shape,
                                  uint16_t codeword) {
  const float* const found = tables.coefficients + 16u * uint32_t{codeword};
  float* const errors = lane.memory.errors + 16 * lane.surprise_class;
  int32_t* const octaves = lane.memory.octaves + 16 * lane.surprise_class;
  alignas(64) float wrong_by[16];
#pragma GCC unroll 4
  for (int i = 0; i < 16; i += kLanes) {
    const native::Floats wrong =
        magnitude(native::load(found + i) - native::load(lane.predicted + i));
    const native::Floats usual = native::load(errors + i);
    const native::Floats learned = usual + (wrong - usual) * kForgetting;
    native::store(wrong_by + i, wrong);
    native::store(errors + i, learned);
    native::store(octaves + i, quarter_octaves(learned));
  }
  *lane.here = {sum_of(wrong_by) / 4.0f, codeword, kOccupied};
  set(lane.index, codeword);
  go_on<kHasMeans>(lane, shape);
}

/// All lanes' ways to their codewords, turn by turn: one computes while another waits.
AF_KERNEL_INLINE void find_ways(Lane<RangeDecoder, uint16_t>* lanes,
                                int count,
                                const CodewordTables& tables) {
  // All lanes come to the end of a cluster at the same level.
  int in_cluster = (tables.depth + kLevelsOfCluster - 1) % kLevelsOfCluster + 1;
  for (int level = 0; level < tables.depth; level += in_cluster, in_cluster = kLevelsOfCluster) {
    for (int i = 0; i < count; ++i) enter_cluster(lanes[i], tables);
    const bool is_last = level + in_cluster == tables.depth;
    for (int turn = is_last ? 1 : 0; turn < in_cluster; ++turn)
      for (int i = 0; i < count; ++i) take_turn(lanes[i], false);
    if (is_last)
      for (int i = 0; i < count; ++i)
        if (tables.codewords_at[lanes[i].number] == 0) take_turn(lanes[i], false);
    for (int i = 0; i < count; ++i) leave_cluster(lanes[i]);
  }
}

template <bool kHasMeans>
AF_KERNEL_INLINE int64_t encode(const CodewordTables& tables,
                                const BlockShape& shape,
                                const BlockMemory& memory,
                                const uint16_t* indices,
                                uint8_t* bytes) {
  Lane<RangeEncoder, const uint16_t> lane;
  lane.coder = RangeEncoder(bytes);
  begin(lane, shape, memory, indices);
  while (go_to_occupied<kHasMeans>(lane, tables, shape)) {
    const uint16_t codeword = *lane.index;
    const uint32_t leaf = tables.leaves[codeword];
    for (int left = 30 - __builtin_clz(leaf); left >= 0;) {
      enter_cluster(lane, tables);
      for (; left >= 0 && lane.within_cluster < kNodesOfCluster; --left)
        take_turn(lane, (leaf >> static_cast<uint32_t>(left) & 1u) != 0);
      leave_cluster(lane);
    }
    finish_tile<kHasMeans>(lane, tables, shape, codeword);
  }
  return lane.coder.finish();
}

template <bool kHasMeans>
AF_KERNEL_INLINE void decode(const CodewordTables& tables,
                             const BlockShape& shape,
                             const BlockMemory* memories,
                             BlockToDecode* blocks,
                             int count) {
  Lane<RangeDecoder, uint16_t> lanes[kBlocksAtOnce];
  for (int i = 0; i < count; ++i) {
    lanes[i].coder = RangeDecoder(blocks[i].bytes, blocks[i].byte_count);
    lanes[i].is_exhausted = &blocks[i].is_exhausted;
    begin(lanes[i], shape, memories[i], blocks[i].indices);
  }
  for (int under_way = count; under_way > 0;) {
    for (int i = 0; i < under_way;) {
      if (go_to_occupied<kHasMeans>(lanes[i], tables, shape)) {
        ++i;
        continue;
      }
      *lanes[i].is_exhausted = lanes[i].coder.is_exhausted();
      lanes[i] = lanes[--under_way];
    }
    find_ways(lanes, under_way, tables);
    for (int i = 0; i < under_way; ++i)
      prefetch_coefficients(tables, tables.codewords_at[lanes[i].number]);
    for (int i = 0; i < under_way; ++i)
      finish_tile<kHasMeans>(lanes[i], tables, shape, tables.codewords_at[lanes[i].number]);
  }
}

}  // namespace

int64_t encode_block(const CodewordTables& tables,
                     const BlockShape& shape,
                     const BlockMemory& memory,
                     const uint16_t* indices,
                     uint8_t* bytes) {
  return tables.mean_step > 0 ? encode<true>(tables, shape, memory, indices, bytes)
                              : encode<false>(tables, shape, memory, indices, bytes);
}

void decode_blocks(const CodewordTables& tables,
                   const BlockShape& shape,
                   const BlockMemory* memories,
                   BlockToDecode* blocks,
                   int count) {
  tables.mean_step > 0 ? decode<true>(tables, shape, memories, blocks, count)
                       : decode<false>(tables, shape, memories, blocks, count);
}

}  // namespace af::AF_KERNEL_NAMESPACE
