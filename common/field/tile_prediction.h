// SPDX-License-Identifier: Apache-2.0
// For kernels only: prediction of a tile from its neighbours.
#pragma once

#include "base/vec_native.h"

namespace af::AF_KERNEL_NAMESPACE {

/// Neighbours from which a tile is predicted, all before it in the order of tiles: u - 1; s - 1;
/// t - 1; s - 1, t - 1; u - 1, s + 1; u - 1, t + 1; u - 1, s - 1; u - 1, t - 1.
inline constexpr int kPredictors = 8;

/// Hadamard coefficients of the neighbours. `plain` serves the terms that keep a coefficient's
/// place, `turned` those that take it from another place. `turned` is zero where another tile
/// replaces a missing neighbour.
struct PredictionInputs {
  const float* plain[kPredictors];
  const float* turned[kPredictors];
};

/// What coefficient j of the tile takes from coefficient j ^ turn of a neighbour, in 64ths. An axis
/// along which the neighbour lies may be turned: the slope there says how the mean goes on.
struct Term {
  int neighbour;
  int turn;
  int8_t weights[16];
};

/// Least squares over the tiles of one field of the paper's design, two of four slabs and one of
/// eight (a skull and a thorax); part of the format. The tree of a codebook decides what a poor
/// prediction costs, so the weights need not suit a field.
inline constexpr Term kTerms[] = {
    // clang-format off
    // u - 1
    {0, 0, {9, 21, 14, 17, 15, 17, 8, 15, 7, 8, 3, 10, 7, 11, 8, 4}},
    {0, 8, {-20, -18, -1, -15, -5, -14, -6, -4, 0, 0, 0, 1, 0, 0, 1, 1}},
    // s - 1
    {1, 0, {22, 15, -1, -3, 25, 18, 1, 2, 6, 3, -4, -3, 12, 7, 1, 0}},
    {1, 2, {-69, -65, 0, 1, -80, -42, 1, 1, -20, -24, 2, 4, -22, -15, 3, 4}},
    // t - 1
    {2, 0, {35, 10, 45, 11, 14, 1, 14, 10, 44, 13, 32, 16, 20, 12, 18, 6}},
    {2, 1, {-81, 0, -110, 1, -20, 1, -43, 5, -117, 0, -75, 1, -41, 3, -30, 4}},
    // s - 1, t - 1
    {3, 0, {-10, -1, 1, 6, -3, 1, 5, 7, 1, 5, 1, 5, 2, 3, 3, 3}},
    {3, 2, {5, -7, 0, 0, -23, -1, 0, 0, -8, -6, 0, 1, -9, -4, 1, 1}},
    {3, 1, {11, 0, 1, 0, 1, 0, 4, -1, -17, 0, 21, 0, -6, 0, 7, -1}},
    {3, 3, {12, -1, -2, 0, 121, -7, 0, 0, 105, 0, -10, 0, 17, -4, -7, 0}},
    // u - 1, s + 1
    {4, 0, {9, 16, 3, 2, 16, 17, 3, 7, 3, 3, 0, 2, 0, 3, 2, 0}},
    {4, 8, {-19, -24, 1, 8, -21, -14, 1, 0, 0, 0, 0, -1, 0, 0, -2, -2}},
    {4, 2, {10, 17, 0, -1, 6, 1, 0, -1, -1, 12, -1, 0, 9, 5, 1, 0}},
    {4, 10, {13, -60, 6, 4, 1, 3, 0, 3, 1, 0, 0, 0, 2, 4, 0, 0}},
    // u - 1, t + 1
    {5, 0, {8, 0, 9, 0, 1, -1, -1, -2, 5, -2, 0, 0, -2, 0, 1, -2}},
    {5, 8, {-26, -8, -8, -6, -10, 3, -9, -4, 0, 0, 0, 0, 0, 0, 2, 1}},
    {5, 1, {16, 0, 22, 0, 3, 0, 14, 0, 7, 0, 17, 0, 8, 1, 0, 0}},
    {5, 9, {22, 6, 17, 1, -20, 0, -7, 1, 0, 0, 1, 0, 0, 0, 2, -1}},
    // u - 1, s - 1
    {6, 0, {3, 7, 3, 2, 4, 9, 3, 5, 2, 5, 4, 7, 3, 5, 6, 4}},
    {6, 8, {-7, -11, -3, -7, -4, -6, -2, -2, 0, 0, 0, 0, 0, 0, 0, 0}},
    {6, 2, {23, 15, 0, 0, 23, 17, 0, 0, 8, 6, -1, -1, 8, 3, -1, -1}},
    {6, 10, {-35, 84, -6, -7, 55, 21, -2, -5, -1, -2, 0, 0, -2, -3, 0, 0}},
    // u - 1, t - 1
    {7, 0, {-12, -7, -12, -3, -9, -3, -1, -2, -8, -4, -1, 1, -4, -2, 0, 0}},
    {7, 8, {14, 21, 12, 6, 8, 9, 4, 4, 0, 0, 0, -1, 0, 0, 0, -1}},
    {7, 1, {30, 0, 4, 0, 15, 0, 0, 0, 7, 0, -8, 0, 7, 0, 1, 0}},
    {7, 9, {17, -7, 119, 0, 70, -2, 10, -1, 0, 0, 0, 0, 0, 0, -1, 0}},
    // clang-format on
};
inline constexpr int kTermCount = sizeof(kTerms) / sizeof(kTerms[0]);

/// A vector holds this many of a tile's coefficients, and this many vectors all of them.
inline constexpr int kLanes = native::kLanes;
inline constexpr int kParts = 16 / kLanes;

template <int... kLane>
struct LaneNumbers {};
#if AF_VECTOR_BITS == 512
using AllLanes = LaneNumbers<0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15>;
#elif AF_VECTOR_BITS == 256
using AllLanes = LaneNumbers<0, 1, 2, 3, 4, 5, 6, 7>;
#else
using AllLanes = LaneNumbers<0, 1, 2, 3>;
#endif

/// Each lane's value from the lane ^ kTurn.
template <int kTurn, int... kLane>
AF_KERNEL_INLINE native::Floats turned_by(native::Floats values, LaneNumbers<kLane...>) {
  return __builtin_shufflevector(values, values, (kLane ^ kTurn)...);
}

/// Part `part` of the coefficients of a neighbour, each taken from place j ^ turn.
template <int kTurn>
AF_KERNEL_INLINE native::Floats turned_part(const float* coefficients, int part) {
  return turned_by<kTurn % kLanes>(native::load(coefficients + kLanes * (part ^ (kTurn / kLanes))),
                                   AllLanes{});
}

template <int kTerm>
AF_KERNEL_INLINE native::Floats add_terms_from(const PredictionInputs& inputs,
                                               int part,
                                               native::Floats sum) {
  if constexpr (kTerm == kTermCount) {
    return sum;
  } else {
    constexpr Term kThis = kTerms[kTerm];
    const float* from =
        kThis.turn == 0 ? inputs.plain[kThis.neighbour] : inputs.turned[kThis.neighbour];
    native::Floats weights;
    for (int i = 0; i < kLanes; ++i)
      weights[i] = static_cast<float>(kThis.weights[kLanes * part + i]) / 64.0f;
    return add_terms_from<kTerm + 1>(
        inputs, part, sum + weights * turned_part<kThis.turn>(from, part));
  }
}

/// The 16 coefficients that the neighbours foretell.
AF_KERNEL_INLINE void predict_tile(const PredictionInputs& inputs, float* predicted) {
#pragma GCC unroll 4
  for (int part = 0; part < kParts; ++part)
    native::store(predicted + kLanes * part, add_terms_from<0>(inputs, part, native::Floats{}));
}

}  // namespace af::AF_KERNEL_NAMESPACE
