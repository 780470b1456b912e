// SPDX-License-Identifier: Apache-2.0
#include "precompute/design/design_model.h"

#include <cmath>
#include <limits>

#include "base/error.h"
#include "precompute/design/drr_time.h"
#include "precompute/design/quantisation_probe.h"

namespace af {

namespace {

// These exponents were found on three CTs.
constexpr double kUvExponent = 3.0;
constexpr double kStExponent = 2.1;
constexpr double kQuantisationUvExponent = 1.0;
/// Exponent of the fall of the squared error with the codewords.
constexpr double kCodewordExponent = 0.4;
/// Extra bits per index for each doubling of the codewords.
constexpr double kBitsPerDoubling = 1.5;

double from_db(double decibels) {
  return std::pow(10.0, -0.1 * decibels);
}
double to_db(double mean_square) {
  return -10.0 * std::log10(mean_square);
}

double viewpoints(const FieldDesign& design) {
  return design.slabs * (design.uv_nodes - 1.0) / 60.0;
}
double st_cells(const FieldDesign& design) {
  return (design.st_nodes - 1.0) / 384.0;
}

double log_ratio(double a, double b) {
  return std::log(a / b);
}

double distance(const FieldDesign& a, const FieldDesign& b) {
  const double slabs = log_ratio(a.slabs, b.slabs);
  const double uv = log_ratio(viewpoints(a), viewpoints(b));
  const double st = log_ratio(a.st_nodes, b.st_nodes);
  const double codewords = log_ratio(a.codewords, b.codewords);
  return slabs * slabs + 4.0 * uv * uv + 4.0 * st * st + 0.25 * codewords * codewords;
}

double tiles(const FieldDesign& design) {
  return 1.0 * design.slabs * design.uv_nodes * design.uv_nodes * design.st_nodes * design.st_nodes;
}

}  // namespace

double DesignModel::interpolation_law(const FieldDesign& design) const {
  return (1.0 - st_share_) * std::pow(viewpoints(design), -kUvExponent) +
         st_share_ * std::pow(st_cells(design), -kStExponent);
}

double DesignModel::quantisation_law(const FieldDesign& design) const {
  return std::pow(viewpoints(design), -kQuantisationUvExponent) *
         std::pow(st_cells(design), -st_exponent_) *
         std::pow(1.0 * design.codewords, -kCodewordExponent);
}

void DesignModel::fit() {
  // The values under which the law explains the points best. The middle where it does not matter.
  const auto fitted = [&](double& value, double low, double high, const auto& law, const auto& db) {
    const double middle = value;
    double best = std::numeric_limits<double>::infinity();
    double best_value = middle;
    constexpr int kSteps = 40;
    for (int i = 0; i <= kSteps; ++i) {
      value = low + (high - low) * i / kSteps;
      double sum = 0.0;
      double sum_of_squares = 0.0;
      for (const DesignPoint& point : points_) {
        const double residual = db(point.forecast) - to_db(law(point.forecast.design));
        sum += residual;
        sum_of_squares += residual * residual;
      }
      // Two or three points prove little, so extreme values cost some squared decibels.
      constexpr double kCaution = 12.0;
      const double excess = (value - middle) / (high - low);
      const double cost = sum_of_squares - sum * sum / static_cast<double>(points_.size()) +
                          kCaution * excess * excess;
      if (!(cost < best)) continue;
      best = cost;
      best_value = value;
    }
    value = best_value;
  };
  st_share_ = 0.5;
  st_exponent_ = 1.0;
  fitted(
      st_share_,
      0.02,
      0.98,
      [&](const FieldDesign& design) { return interpolation_law(design); },
      [](const DesignForecast& forecast) { return forecast.interpolation_db; });
  fitted(
      st_exponent_,
      0.0,
      2.0,
      [&](const FieldDesign& design) { return quantisation_law(design); },
      [](const DesignForecast& forecast) { return forecast.quantisation_db; });
}

const DesignPoint& DesignModel::nearest(const FieldDesign& design) const {
  const DesignPoint* found = nullptr;
  double least = std::numeric_limits<double>::infinity();
  for (const DesignPoint& point : points_) {
    if (point.forecast.design.look_up != design.look_up) continue;
    const double here = distance(point.forecast.design, design);
    if (!(here < least)) continue;
    least = here;
    found = &point;
  }
  check(found != nullptr, "a model needs a measured design of that look-up");
  return *found;
}

DesignForecast DesignModel::forecast(const FieldDesign& design) const {
  const DesignPoint& point = nearest(design);
  const DesignForecast& known = point.forecast;
  DesignForecast forecast = known;
  forecast.design = design;
  const double interpolation =
      from_db(known.interpolation_db) * interpolation_law(design) / interpolation_law(known.design);
  const double quantisation =
      from_db(known.quantisation_db) * quantisation_law(design) / quantisation_law(known.design);
  // The median of the sums is not quite the sum of the medians.
  const double excess =
      known.psnr_db - to_db(from_db(known.interpolation_db) + from_db(known.quantisation_db));
  forecast.interpolation_db = to_db(interpolation);
  forecast.quantisation_db = to_db(quantisation);
  forecast.psnr_db = to_db(interpolation + quantisation) + excess;
  const double grown = tiles(design) / tiles(known.design);
  const double more_bits =
      kBitsPerDoubling * std::log2(1.0 * design.codewords / known.design.codewords);
  const double codebook_bytes = kFileBytesPerCodeword * known.design.codewords;
  forecast.file_bytes =
      (known.file_bytes - codebook_bytes + more_bits / 8.0 * point.occupied_tiles) * grown +
      kFileBytesPerCodeword * design.codewords;
  const double node_ratio = (design.st_nodes - 1.0) / (known.design.st_nodes - 1.0);
  forecast.drr_ms =
      estimated_drr_ms(design, point.drr_pixels, point.footprint_nodes * node_ratio * node_ratio);
  return forecast;
}

}  // namespace af
