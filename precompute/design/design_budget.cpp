// SPDX-License-Identifier: Apache-2.0
#include "precompute/design/design_budget.h"

#include "base/joined.h"
#include "base/number_text.h"

namespace af {

void DesignBudget::describe(Fields& field) {
  field("target_psnr_db",
        target_psnr_db,
        "Choose the smallest design whose DRRs have this median PSNR against ray casting, dB")
      .within(10.0, 90.0);
  field("max_field_bytes",
        max_field_bytes,
        "Choose the best design whose file is at most this large, e.g. 8MB")
      .as("--max-field-size")
      .size()
      .at_least(1.0);
  field(
      "max_drr_ms",
      max_drr_ms,
      "Choose a design that needs at most this time per DRR of the whole detector on one core, ms")
      .above(0.0)
      .finite();
}

std::string to_text(const DesignBudget& budget) {
  std::vector<std::string> limits;
  if (budget.target_psnr_db)
    limits.push_back("at least " + number_text(*budget.target_psnr_db) + " dB");
  if (budget.max_field_bytes)
    limits.push_back("at most " + number_text(static_cast<double>(*budget.max_field_bytes) / 1e6) +
                     " MB");
  if (budget.max_drr_ms)
    limits.push_back("at most " + number_text(*budget.max_drr_ms) + " ms per DRR");
  return joined(limits);
}

FieldDesign DesignParts::over(FieldDesign design) const {
  design.slabs = slabs.value_or(design.slabs);
  design.uv_nodes = uv_nodes.value_or(design.uv_nodes);
  design.st_nodes = st_nodes.value_or(design.st_nodes);
  design.codewords = codewords.value_or(design.codewords);
  design.look_up = look_up.value_or(design.look_up);
  design.mean_step = mean_step.value_or(design.mean_step);
  design.fits_uv = fits_uv.value_or(design.fits_uv);
  design.filters_tiles = filters_tiles.value_or(design.filters_tiles);
  return design;
}

}  // namespace af
