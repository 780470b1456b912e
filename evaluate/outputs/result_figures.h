// SPDX-License-Identifier: Apache-2.0
// The figures of the paper's evaluation, as SVG and PNG; figures without a table of their own also
// get a CSV of the plotted data.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "evaluate/statistics/success_rate.h"

namespace af::evaluation {

/// PSNR of one field's DRRs (dB); infinite values (equal images) are left out of the drawing.
struct PsnrGroup {
  std::string label;  ///< "camera A"
  std::vector<double> psnr_db;
};

/// Whether a figure may show the paper's PSNR levels, which hold for the paper's motion range and
/// camera alone (see paper_setting.h).
enum class PaperLevels { Hidden, Shown };

/// Box plots (Fig. 8): box from quartile to quartile with the median, whiskers from the 5th to the
/// 95th percentile, every pose as a dot, and lines at 36 and 40 dB, or at all of the paper's
/// levels.
void draw_psnr_boxes(const std::vector<PsnrGroup>& groups,
                     PaperLevels levels,
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
                        const std::filesystem::path& path_without_extension,
                        double success_tre_mm = kSuccessTreMm);

/// Histogram of TRE (Fig. 15) as shares of each group's registrations; the last bar holds
/// everything beyond, failures without a pose included.
void draw_tre_histogram(const std::vector<OutcomeGroup>& groups,
                        const std::filesystem::path& path_without_extension,
                        double success_tre_mm = kSuccessTreMm);

/// Initial against final TRE, one dot per registration, logarithmic final TRE. Above 4000 dots,
/// only every second, third, ... is drawn, and the title says so.
/// \test Figures.DrawAPartOfVeryManyStartsAndSaySo
void draw_tre_scatter(const std::vector<OutcomeGroup>& groups,
                      double largest_initial_mm,
                      const std::filesystem::path& path_without_extension,
                      double success_tre_mm = kSuccessTreMm);

/// One curve of a panel; NaN values are holes.
struct PanelCurve {
  std::string label;
  std::vector<double> x;
  std::vector<double> y;
  double peak_x = 0.0;
  double peak_y = 0.0;
};

struct CurvePanel {
  std::string x_label;
  std::vector<PanelCurve> curves;
};

/// Panels in rows of three with one common y axis, each with its curves, their highest points
/// marked and a line at x = 0 (Fig. 14).
void draw_curve_panels(const std::vector<CurvePanel>& panels,
                       const std::string& title,
                       const std::string& y_label,
                       const std::filesystem::path& path_without_extension);

/// Median and quartiles of a quantity over settings.
struct SweepPoint {
  double x = 0.0;
  double low = 0.0;
  double middle = 0.0;
  double high = 0.0;
  bool is_base = false;  ///< the setting that all sweeps share
};

struct SweepPanel {
  std::string x_label;
  bool is_logarithmic = true;
  std::vector<SweepPoint> points;  ///< ascending x
};

/// Panels in rows of two with one common y axis: medians joined by a line, bars from `low` to
/// `high`, the shared setting in another colour (Fig. 10).
void draw_sweep_panels(const std::vector<SweepPanel>& panels,
                       const std::string& title,
                       const std::string& y_label,
                       const std::filesystem::path& path_without_extension);

}  // namespace af::evaluation
