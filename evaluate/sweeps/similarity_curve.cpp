// SPDX-License-Identifier: Apache-2.0
#include "evaluate/sweeps/similarity_curve.h"

#include <array>
#include <cmath>
#include <cstddef>

#include "base/error.h"
#include "base/sample_summary.h"

namespace af::evaluation {
namespace {

/// Where the curve crosses `level` on the way from `peak` in this direction. NaN when it does not
/// before its end or a hole.
double crossing(double level,
                std::span<const double> offsets,
                std::span<const double> similarity,
                std::size_t peak,
                int direction) {
  for (auto i = static_cast<std::ptrdiff_t>(peak);;) {
    const std::ptrdiff_t next = i + direction;
    if (next < 0 || next >= static_cast<std::ptrdiff_t>(offsets.size())) return kNan;
    const auto a = static_cast<std::size_t>(i);
    const auto b = static_cast<std::size_t>(next);
    if (!std::isfinite(similarity[b])) return kNan;
    if (similarity[b] <= level) {
      const double share = (similarity[a] - level) / (similarity[a] - similarity[b]);
      return offsets[a] + share * (offsets[b] - offsets[a]);
    }
    i = next;
  }
}

double parabola_vertex(std::span<const double> offsets,
                       std::span<const double> similarity,
                       std::size_t peak) {
  if (peak == 0 || peak + 1 == offsets.size()) return offsets[peak];
  const double before = similarity[peak - 1];
  const double after = similarity[peak + 1];
  const double curvature = before - 2 * similarity[peak] + after;
  if (!(curvature < 0.0)) return offsets[peak];
  return offsets[peak] + 0.5 * (before - after) / curvature * (offsets[peak + 1] - offsets[peak]);
}

}  // namespace

PoseParameters along_axis(int axis, double offset) {
  std::array<double, kPoseParameters> values{};
  values[static_cast<std::size_t>(axis)] = offset;
  return PoseParameters::from_deg_and_mm(values);
}

std::vector<double> curve_offsets(double half_width, double step) {
  check(half_width > 0.0 && step > 0.0 && step <= half_width, "a curve has a width and a step");
  // A width that is a whole number of steps, except for rounding, includes its end.
  const auto steps = static_cast<int>(half_width / step + 1e-9);
  std::vector<double> offsets;
  for (int i = -steps; i <= steps; ++i) offsets.push_back(i * step);
  return offsets;
}

CurvePeak find_peak(std::span<const double> offsets,
                    std::span<const double> similarity,
                    double base) {
  check(offsets.size() == similarity.size(), "a curve has a value per offset");
  std::size_t peak = offsets.size();
  for (std::size_t i = 0; i < offsets.size(); ++i)
    if (std::isfinite(similarity[i]) &&
        (peak == offsets.size() || similarity[i] > similarity[peak]))
      peak = i;
  if (peak == offsets.size())
    throw InputError("similarity curve: every pose lies outside the field");
  const double level = 0.5 * (similarity[peak] + base);
  return {parabola_vertex(offsets, similarity, peak),
          similarity[peak],
          peak == 0 || peak + 1 == offsets.size(),
          crossing(level, offsets, similarity, peak, 1) -
              crossing(level, offsets, similarity, peak, -1)};
}

}  // namespace af::evaluation
