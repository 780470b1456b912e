// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "precompute/design/field_design.h"

namespace af {

/// Measured forecast of one design, look-up and codebook size, and what the model needs to
/// extrapolate from it.
struct DesignPoint {
  DesignForecast forecast;
  double occupied_tiles = 0.0;
  double drr_pixels = 0.0;
  double footprint_nodes = 0.0;
};

/// Extrapolates forecasts from measured designs by power laws. Losses fall over (u,v) with the
/// number of viewpoints times slabs, and over (s,t) with the nodes. The weight of each law is
/// fitted to the points. At a measured point it returns that point's forecast.
class DesignModel {
 public:
  void add(const std::vector<DesignPoint>& points) {
    points_.insert(points_.end(), points.begin(), points.end());
  }
  [[nodiscard]] const std::vector<DesignPoint>& points() const { return points_; }

  /// Fits the shares. Call it after add().
  void fit();

  /// Extrapolates from the nearest point with that look-up. There must be one.
  [[nodiscard]] DesignForecast forecast(const FieldDesign& design) const;

 private:
  [[nodiscard]] const DesignPoint& nearest(const FieldDesign& design) const;
  [[nodiscard]] double interpolation_law(const FieldDesign& design) const;
  [[nodiscard]] double quantisation_law(const FieldDesign& design) const;

  std::vector<DesignPoint> points_;
  double st_share_ = 0.5;     ///< share in the interpolation loss of a middling design
  double st_exponent_ = 1.0;  ///< for the quantisation loss
};

}  // namespace af
