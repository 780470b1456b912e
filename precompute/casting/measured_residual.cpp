// SPDX-License-Identifier: Apache-2.0
#include "precompute/casting/measured_residual.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "base/error.h"
#include "base/number_text.h"
#include "geometry/pinhole_camera.h"

namespace af {

namespace {

/// Cells along the longest side of the CT's attenuating part.
constexpr int kMostCells = 32;
/// Sources farther than this share of the circle's radius from its plane are not on a circle.
constexpr double kMostBeside = 0.1;
/// Only views that look at the CT within this cosine of the field's own direction are used.
constexpr double kLeastCosine = 0.2;

Eigen::Vector3d mean_source(std::span<const ResidualView> views) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const ResidualView& view : views) sum += view.camera.source_point;
  return sum / static_cast<double>(views.size());
}

/// Normal of the sources' plane, from the two sources that span the widest triangle with their
/// mean. Zero when all lie on a line.
Eigen::Vector3d plane_normal(std::span<const ResidualView> views, const Eigen::Vector3d& middle) {
  Eigen::Vector3d widest = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < views.size(); ++i)
    for (std::size_t j = i + 1; j < views.size(); ++j) {
      const Eigen::Vector3d normal =
          (views[i].camera.source_point - middle).cross(views[j].camera.source_point - middle);
      if (normal.squaredNorm() > widest.squaredNorm()) widest = normal;
    }
  const double length = widest.norm();
  return length > 0.0 ? Eigen::Vector3d(widest / length) : widest;
}

double bilinear(const float* image, int width, int height, double column, double row) {
  if (!(column >= 0.0) || !(row >= 0.0) || column > width - 1 || row > height - 1) return 0.0;
  const int c = std::min(static_cast<int>(column), width - 2);
  const int r = std::min(static_cast<int>(row), height - 2);
  const double right = column - c;
  const double below = row - r;
  const float* const at = image + static_cast<std::ptrdiff_t>(r) * width + c;
  const auto upper =
      (1.0 - right) * static_cast<double>(at[0]) + right * static_cast<double>(at[1]);
  const auto lower =
      (1.0 - right) * static_cast<double>(at[width]) + right * static_cast<double>(at[width + 1]);
  return (1.0 - below) * upper + below * lower;
}

/// The part of a line, as multiples of `change`, within the box [0, size] of cells.
bool cut_to_box(const Eigen::Vector3d& start,
                const Eigen::Vector3d& change,
                const std::array<int, 3>& size,
                double& begin,
                double& end) {
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const double width = size[static_cast<std::size_t>(axis)];
    if (change[axis] == 0.0) {
      if (start[axis] < 0.0 || start[axis] > width) return false;
      continue;
    }
    const double a = -start[axis] / change[axis];
    const double b = (width - start[axis]) / change[axis];
    begin = std::max(begin, std::min(a, b));
    end = std::min(end, std::max(a, b));
  }
  return begin < end;
}

}  // namespace

std::vector<std::string> orbit_problems(std::span<const ResidualView> views) {
  constexpr std::size_t kFewest = 3;
  if (views.size() < kFewest)
    return {"views = " + std::to_string(views.size()) + ": must be at least " +
            std::to_string(kFewest)};
  const Eigen::Vector3d middle = mean_source(views);
  const Eigen::Vector3d normal = plane_normal(views, middle);
  if (normal.isZero()) return {"the sources lie on a line: they must go around the CT"};
  for (const ResidualView& view : views) {
    const Eigen::Vector3d from_middle = view.camera.source_point - middle;
    const double beside = std::abs(from_middle.dot(normal));
    if (beside > kMostBeside * from_middle.norm())
      return {"camera '" + view.camera.name + "': its source is " + number_text(beside) +
              " mm from the plane of the others: the sources must lie on a circle"};
  }
  return {};
}

MeasuredResidual::MeasuredResidual(std::span<const ResidualView> views,
                                   const AttenuationVolume& volume,
                                   const Eigen::Vector3d& toward_source) {
  throw_if_any(orbit_problems(views));
  axis_ = plane_normal(views, mean_source(views));
  select_views(views, toward_source);
  make_profile(volume);
}

void MeasuredResidual::select_views(std::span<const ResidualView> views,
                                    const Eigen::Vector3d& toward_source) {
  const Eigen::Vector3d tangent = axis_.cross(toward_source).normalized();
  const Eigen::Vector3d outward = tangent.cross(axis_);
  std::vector<std::pair<double, Projection>> found;
  for (const ResidualView& view : views) {
    const CameraGeometry& camera = view.camera;
    // The direction towards the source. Neither the circle's middle nor the field's centre need be
    // on the axis.
    const Eigen::Vector3d away = -camera.beam_direction();
    const double out = away.dot(outward);
    if (!(out > kLeastCosine)) continue;
    Projection projection;
    projection.source_point = camera.source_point;
    const Eigen::Matrix<double, 3, 4> pixels_from_ct = projection_matrix_of(camera);
    projection.pixels_from_ct = pixels_from_ct.leftCols<3>();
    projection.pixels_of_origin = pixels_from_ct.col(3);
    projection.width = camera.size_px.x();
    projection.height = camera.size_px.y();
    projection.residual = view.residual.data();
    // The tangent of the angle has the same order as the angle.
    found.emplace_back(away.dot(tangent) / out, projection);
  }
  std::stable_sort(
      found.begin(), found.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  for (const auto& [place, projection] : found) views_.push_back(projection);
}

void MeasuredResidual::make_profile(const AttenuationVolume& volume) {
  const CtGrid& grid = volume.grid();
  const int longest = *std::max_element(grid.size.begin(), grid.size.end());
  const int side = std::max(1, (longest + kMostCells - 1) / kMostCells);
  for (std::size_t axis = 0; axis < 3; ++axis) cells_[axis] = (grid.size[axis] + side - 1) / side;
  const auto cells = [&](std::size_t axis) { return static_cast<std::size_t>(cells_[axis]); };
  attenuation_.assign(cells(0) * cells(1) * cells(2), 0.0F);
  std::size_t voxel = 0;
  for (int k = 0; k < grid.size[2]; ++k)
    for (int j = 0; j < grid.size[1]; ++j) {
      const std::size_t row =
          (static_cast<std::size_t>(k / side) * cells(1) + static_cast<std::size_t>(j / side)) *
          cells(0);
      // Sums of at most 16777216 stay exact. Beyond that they still are weights.
      for (int i = 0; i < grid.size[0]; ++i, ++voxel)
        attenuation_[row + static_cast<std::size_t>(i / side)] +=
            static_cast<float>(volume.voxels()[voxel]);
    }
  const Eigen::Vector3d per_mm = (grid.spacing_mm * side).cwiseInverse();
  cells_from_ct_ = per_mm.asDiagonal() * grid.direction.transpose();
  // Voxel 0 begins half a voxel before its centre.
  cells_of_origin_ = Eigen::Vector3d::Constant(0.5 / side) - cells_from_ct_ * grid.origin_mm;
}

bool MeasuredResidual::find_neighbours(const Eigen::Vector3d& viewpoint,
                                       const Eigen::Vector3d& direction,
                                       Neighbours& neighbours) const {
  if (views_.size() < 2) return false;
  const Eigen::Vector3d normal = direction.cross(axis_);
  const auto beside = [&](std::size_t view) {
    return (views_[view].source_point - viewpoint).dot(normal);
  };
  const double first = beside(0);
  const double last = beside(views_.size() - 1);
  if ((first > 0.0) == (last > 0.0)) return false;
  std::size_t low = 0;
  std::size_t high = views_.size() - 1;
  while (high - low > 1) {
    const std::size_t middle = (low + high) / 2;
    ((beside(middle) > 0.0) == (first > 0.0) ? low : high) = middle;
  }
  const double a = beside(low);
  const double b = beside(high);
  neighbours = {&views_[low], &views_[high], a == b ? 0.0 : a / (a - b)};
  return true;
}

float MeasuredResidual::attenuation_at(const Eigen::Vector3d& cell) const {
  const auto index = [&](Eigen::Index axis) {
    const int last = cells_[static_cast<std::size_t>(axis)] - 1;
    return static_cast<std::size_t>(std::clamp(static_cast<int>(cell[axis]), 0, last));
  };
  const auto width = static_cast<std::size_t>(cells_[0]);
  const auto height = static_cast<std::size_t>(cells_[1]);
  return attenuation_[(index(2) * height + index(1)) * width + index(0)];
}

double MeasuredResidual::along(const Eigen::Vector3d& viewpoint,
                               const Eigen::Vector3d& through,
                               double begin,
                               double end) const {
  const Eigen::Vector3d direction = through - viewpoint;
  const Line cells{cells_from_ct_ * viewpoint + cells_of_origin_, cells_from_ct_ * direction};
  double enter = 0.0;
  double leave = std::numeric_limits<double>::infinity();
  if (!cut_to_box(cells.start, cells.change, cells_, enter, leave)) return 0.0;
  Neighbours neighbours{};
  if (!find_neighbours(viewpoint, direction, neighbours)) return 0.0;
  const std::array views = {neighbours.first, neighbours.second};
  const std::array shares = {1.0 - neighbours.share, neighbours.share};
  std::array<Line, 2> pixels;
  for (std::size_t i = 0; i < 2; ++i)
    pixels[i] = {views[i]->pixels_from_ct * viewpoint + views[i]->pixels_of_origin,
                 views[i]->pixels_from_ct * direction};
  // One sample per cell, at the middles of equal steps.
  const double longest = (leave - enter) * cells.change.norm();
  const int samples = std::max(1, static_cast<int>(longest) + 1);
  const double step = (leave - enter) / samples;
  double weights = 0.0;
  double sum = 0.0;
  for (int sample = 0; sample < samples; ++sample) {
    const double place = enter + (sample + 0.5) * step;
    const auto weight = static_cast<double>(attenuation_at(cells.start + place * cells.change));
    if (weight == 0.0) continue;
    weights += weight;
    if (place < begin || place >= end) continue;
    for (std::size_t i = 0; i < 2; ++i) {
      const Eigen::Vector3d pixel = pixels[i].start + place * pixels[i].change;
      sum += weight * shares[i] *
             bilinear(views[i]->residual,
                      views[i]->width,
                      views[i]->height,
                      pixel.x() / pixel.z(),
                      pixel.y() / pixel.z());
    }
  }
  return weights > 0.0 ? sum / weights : 0.0;
}

}  // namespace af
