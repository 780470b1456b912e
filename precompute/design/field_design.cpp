// SPDX-License-Identifier: Apache-2.0
#include "precompute/design/field_design.h"

namespace af {

std::string to_text(const FieldDesign& design) {
  const auto square = [](int nodes) {
    return std::to_string(nodes) + " x " + std::to_string(nodes);
  };
  return std::to_string(design.slabs) + (design.slabs == 1 ? " slab, " : " slabs, ") +
         square(design.uv_nodes) + (design.fits_uv ? " fitted" : "") + " (u,v) nodes, " +
         square(design.st_nodes) + " (s,t) nodes, " + std::to_string(design.codewords) +
         " codewords" +
         (design.mean_step > 0
              ? " of mean-removed tiles (step " + std::to_string(design.mean_step) + "), "
              : ", ") +
         (design.filters_tiles ? "a tile filter, " : "") + design.look_up + " look-up";
}

}  // namespace af
