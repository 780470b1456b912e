// SPDX-License-Identifier: Apache-2.0
#include "geometry/target_box.h"

#include <array>
#include <cmath>
#include <cstddef>

#include "base/error.h"
#include "base/number_text.h"
#include "base/plausible.h"

namespace af {

std::string target_box_problem(const CtBox& box, double max_spacing_mm) {
  check(max_spacing_mm > 0.0, "the spacing of target points is positive");
  constexpr double kMostPoints = 1e7;  // 240 MB; at 2 mm a box with sides of 430 mm
  const Eigen::Vector3d extent = box.high_mm - box.low_mm;
  if (!(extent.allFinite() && extent.minCoeff() > 0.0))
    return "must be [[low x, y, z], [high x, y, z]] with low < high on every axis";
  const bool is_beyond_a_ct = !(extent.maxCoeff() <= 2.0 * kMaxCtOriginMm);
  if (is_beyond_a_ct || !((extent / max_spacing_mm).array().ceil().prod() <= kMostPoints))
    return "must be smaller: sides of at most 2e4 mm (20 m), at most 1e7 cells of " +
           number_text(max_spacing_mm) + " mm in all";
  return {};
}

std::vector<Eigen::Vector3d> target_points(const CtBox& box, double max_spacing_mm) {
  if (const std::string problem = target_box_problem(box, max_spacing_mm); !problem.empty())
    throw InputError("target_box_ct_mm: " + problem);
  const Eigen::Vector3d extent = box.high_mm - box.low_mm;
  std::array<int, 3> cells{};
  for (int axis = 0; axis < 3; ++axis)
    cells[static_cast<std::size_t>(axis)] =
        static_cast<int>(std::ceil(extent[axis] / max_spacing_mm));
  const Eigen::Vector3d cell = extent.cwiseQuotient(Eigen::Vector3d(cells[0], cells[1], cells[2]));
  std::vector<Eigen::Vector3d> points;
  points.reserve(static_cast<std::size_t>(cells[0]) * static_cast<std::size_t>(cells[1]) *
                 static_cast<std::size_t>(cells[2]));
  for (int k = 0; k < cells[2]; ++k)
    for (int j = 0; j < cells[1]; ++j)
      for (int i = 0; i < cells[0]; ++i)
        points.push_back(box.low_mm +
                         cell.cwiseProduct(Eigen::Vector3d(i + 0.5, j + 0.5, k + 0.5)));
  return points;
}

Eigen::Vector3d mean_point(std::span<const Eigen::Vector3d> points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points) sum += point;
  return sum / static_cast<double>(points.size());
}

double rms_radius_mm(const CtBox& box, const Eigen::Vector3d& center_ct_mm) {
  const Eigen::Vector3d offset = (box.low_mm + box.high_mm) / 2.0 - center_ct_mm;
  // The variance of a uniform distribution over a side L is L^2 / 12.
  return std::sqrt(offset.squaredNorm() + (box.high_mm - box.low_mm).squaredNorm() / 12.0);
}

}  // namespace af
