// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "precompute/design/field_design.h"

namespace af {

/// What a measurement says of one design with one look-up and one size of the codebook, and what a
/// model needs to tell its neighbours' by.
struct DesignPoint {
  DesignForecast forecast;
  double occupied_tiles = 0.0;
  double drr_pixels = 0.0;
  double footprint_nodes = 0.0;
};

/// Tells forecasts of designs from those of measured ones by laws of growth: over (u,v), losses
/// fall with the number of viewpoints times slabs; over (s,t), with the nodes; how much each
/// matters is fitted to the points. At a point itself it gives that point's forecast.
class DesignModel {
 public:
  void add(const std::vector<DesignPoint>& points) {
    points_.insert(points_.end(), points.begin(), points.end());
  }
  [[nodiscard]] const std::vector<DesignPoint>& points() const { return points_; }

  /// Fits the shares; call after add().
  void fit();

  /// From the nearest point. At least one point of that look-up must be there.
  [[nodiscard]] DesignForecast forecast(const FieldDesign& design) const;

 private:
  [[nodiscard]] const DesignPoint& nearest(const FieldDesign& design) const;
  [[nodiscard]] double interpolation_law(const FieldDesign& design) const;
  [[nodiscard]] double quantisation_law(const FieldDesign& design) const;

  std::vector<DesignPoint> points_;
  double st_share_ = 0.5;     ///< of the interpolation loss of a middling design
  double st_exponent_ = 1.0;  ///< of the quantisation loss
};

}  // namespace af
