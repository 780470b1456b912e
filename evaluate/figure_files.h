// SPDX-License-Identifier: Apache-2.0
// The figures of the paper's evaluation, as SVG and PNG.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "evaluate/success_rate.h"

namespace af::evaluation {

/// PSNR of one field's DRRs (dB); infinite values (equal images) are left out of the drawing.
struct PsnrGroup {
  std::string label;  ///< "camera A"
  std::vector<double> psnr_db;
};

/// Box plots (Fig. 8): box from quartile to quartile with the median, whiskers from the 5th to the
/// 95th percentile, every pose as a dot, and the paper's levels 36, 40 and 43 dB.
void draw_psnr_boxes(const std::vector<PsnrGroup>& groups,
                     const std::filesystem::path& path_without_extension);

/// The outcomes of one method, e.g. "field".
struct OutcomeGroup {
  std::string label;
  std::vector<TreOutcome> outcomes;
};

/// Success rate per interval of initial TRE with 95 % Wilson intervals (Fig. 16).
void draw_success_rates(const std::vector<OutcomeGroup>& groups,
                        int intervals,
                        double width_mm,
                        const std::filesystem::path& path_without_extension);

/// Histogram of TRE (Fig. 15) as shares of each group's registrations; the last bar holds
/// everything beyond, failures without a pose included.
void draw_tre_histogram(const std::vector<OutcomeGroup>& groups,
                        const std::filesystem::path& path_without_extension);

/// Initial against final TRE, one dot per registration, logarithmic final TRE.
void draw_tre_scatter(const std::vector<OutcomeGroup>& groups,
                      double largest_initial_mm,
                      const std::filesystem::path& path_without_extension);

}  // namespace af::evaluation
