// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/described_fields.h"
#include "precompute/design/field_design.h"

namespace af {

/// Limits on a field's cost and quality. If any is set, a probe chooses the design.
struct DesignBudget {
  std::optional<double> target_psnr_db;  ///< minimum; the smallest file that reaches it is chosen
  std::optional<std::int64_t> max_field_bytes;  ///< of the file
  std::optional<double> max_drr_ms;             ///< estimated, the whole detector on one core

  [[nodiscard]] bool is_stated() const {
    return target_psnr_db.has_value() || max_field_bytes.has_value() || max_drr_ms.has_value();
  }
  void describe(Fields& field);
};

/// "at least 50 dB, at most 8.00 MB"
std::string to_text(const DesignBudget& budget);

/// The stated parts of a design, which a search keeps.
struct DesignParts {
  std::optional<int> slabs;
  std::optional<int> uv_nodes;
  std::optional<int> st_nodes;
  std::optional<int> codewords;
  std::optional<std::string> look_up;
  std::optional<int> mean_step;  ///< 0: plain tiles
  std::optional<bool> fits_uv;
  std::optional<bool> filters_tiles;

  /// `design` with these parts replaced.
  [[nodiscard]] FieldDesign over(FieldDesign design) const;
};

}  // namespace af
