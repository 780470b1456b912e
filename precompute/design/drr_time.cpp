// SPDX-License-Identifier: Apache-2.0
#include "precompute/design/drr_time.h"

namespace af {

double estimated_drr_ms(const FieldDesign& design, double pixels, double nodes) {
  // Fitted to bench-drr-look-up's way of looking up on one and more slabs of two CTs: 8 % off at
  // most.
  constexpr double kNsPerPixel = 0.55;
  constexpr double kNsPerNode = 2.2;            // blended, and summed with other slabs
  constexpr double kNsPerNodeAndUvNode = 0.01;  // more viewpoints, more memory
  constexpr double kNsOfLargeCodebook = 0.3;    // which the second-level cache does not hold
  constexpr double kNsOfCubic = 2.4;            // of the sum's nodes
  const double per_slab = kNsPerNode + kNsPerNodeAndUvNode * design.uv_nodes +
                          (design.codewords > 16384 ? kNsOfLargeCodebook : 0.0);
  const double of_sum = design.look_up == "linear" ? 0.0 : kNsOfCubic;
  return 1e-6 * (kNsPerPixel * pixels + (design.slabs * per_slab + of_sum) * nodes);
}

}  // namespace af
