// SPDX-License-Identifier: Apache-2.0
#include "precompute/design/drr_time.h"

namespace af {

double estimated_drr_ms(const FieldDesign& design, double pixels, double nodes) {
  // Fitted to four fields of one, four and eight slabs of two CTs, and off by 15 % at most.
  const bool is_sum = design.slabs > 1;  // slabs are summed on a plane with more nodes
  constexpr double kNsPerPixel = 0.55;
  constexpr double kNsPerNode = 2.2;
  constexpr double kNsPerNodeAndUvNode = 0.01;  // more viewpoints take more memory
  constexpr double kNsOfLargeCodebook = 0.6;    // the second-level cache does not hold it
  const double per_slab = kNsPerNode + kNsPerNodeAndUvNode * design.uv_nodes +
                          (design.codewords > 16384 ? kNsOfLargeCodebook : 0.0);
  const double of_cubic = design.look_up == "linear" ? 0.0 : (is_sum ? 3.0 : 2.0);
  return 1e-6 * (kNsPerPixel * pixels + (design.slabs * per_slab + of_cubic) * nodes);
}

}  // namespace af
