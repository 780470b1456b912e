// SPDX-License-Identifier: Apache-2.0
#include "precompute/design/drr_time.h"

namespace af {

double estimated_drr_ms(const FieldDesign& design, double pixels, double nodes) {
  // From tests/benchmark/bench-drr-look-up on eight fields of two CTs; it was off by at most 25 %.
  constexpr double kNsPerPixel = 0.65;
  constexpr double kNsPerNode = 3.0;
  constexpr double kNsPerNodeAndUvNode = 0.09;  // more viewpoints, more memory
  constexpr double kNsOfLargeCodebook = 2.0;    // which the second-level cache does not hold
  constexpr double kNsOfCubic = 3.0;
  const double per_node = kNsPerNode + kNsPerNodeAndUvNode * design.uv_nodes +
                          (design.codewords > 16384 ? kNsOfLargeCodebook : 0.0) +
                          (design.look_up == "linear" ? 0.0 : kNsOfCubic);
  return 1e-6 * design.slabs * (kNsPerPixel * pixels + per_node * nodes);
}

}  // namespace af
