// SPDX-License-Identifier: Apache-2.0
// Interface of the vectorised prediction, one function per vector width. Raw pointers only: the
// kernels are compiled for instruction sets that the rest of the program may not use.
#pragma once

namespace af {

/// Neighbours from which a tile is predicted, in the order of kPredictionSteps
/// (index_coding.cpp).
inline constexpr int kPredictors = 8;

/// The Hadamard coefficients of a tile from those of its neighbours. `plain` serves the terms that
/// keep a coefficient's place, `turned` those that take it from another place: zeros, where another
/// tile stands in for a neighbour that is missing.
struct PredictionInputs {
  const float* plain[kPredictors];
  const float* turned[kPredictors];
};

using PredictFunction = void (*)(const PredictionInputs& inputs, float* predicted);

namespace kernels_128 {
void predict_tile(const PredictionInputs& inputs, float* predicted);
}
namespace kernels_256 {
void predict_tile(const PredictionInputs& inputs, float* predicted);
}
namespace kernels_512 {
void predict_tile(const PredictionInputs& inputs, float* predicted);
}

}  // namespace af
