// SPDX-License-Identifier: Apache-2.0
#include "register/problem/target_region.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/error.h"

namespace af::registration {
namespace {

/// Pixels along one axis: the first, and how many.
struct PixelRange {
  int first;
  int count;
};

/// The pixels that an interval touches. Pixel i reaches from i - 0.5 to i + 0.5.
PixelRange pixels_of(double low_px, double high_px) {
  // This is far beyond any detector, and cannot overflow.
  const auto whole = [](double px) { return static_cast<int>(std::clamp(px, -1e6, 1e6)); };
  const int first = whole(std::floor(low_px + 0.5));
  return {first, std::max(1, whole(std::ceil(high_px + 0.5)) - first)};
}

PixelRange about_box(double low_px,
                     double high_px,
                     const std::optional<PixelRange>& stated,
                     bool is_nominal_stated) {
  if (!stated.has_value()) {
    const double margin = 0.25 * (high_px - low_px);
    return pixels_of(low_px - margin, high_px + margin);
  }
  if (!is_nominal_stated) {
    const double first = std::round(0.5 * (low_px + high_px) - 0.5 * (stated->count - 1));
    return {pixels_of(first, first).first, stated->count};
  }
  const PixelRange box = pixels_of(low_px, high_px);
  const int first = std::min(stated->first, box.first);
  return {first, std::max(stated->first + stated->count, box.first + box.count) - first};
}

/// A range that has moved by about `motion_px`.
PixelRange moved(const PixelRange& range, double motion_px, int step_px, int size_px) {
  // It moves only as far as its middle stays on the detector.
  const int middle = range.first + range.count / 2;
  const double lowest = -step_px * (std::max(0, middle) / step_px);
  const double highest = step_px * (std::max(0, size_px - middle) / step_px);
  const int first = range.first + static_cast<int>(std::clamp(
                                      step_px * std::round(motion_px / step_px), lowest, highest));
  return {first, range.count};
}

/// How far the middle of the box's projection has moved since the nominal pose.
Eigen::Vector2d motion_px(const RegistrationProblem& problem,
                          const CameraGeometry& camera,
                          const RigidTransform& room_from_ct) {
  check(problem.target_box_ct.has_value(), "what follows the target box needs one");
  const auto before = projected_box(*problem.target_box_ct, problem.nominal_room_from_ct, camera);
  const auto now = projected_box(*problem.target_box_ct, room_from_ct, camera);
  if (!before.has_value() || !now.has_value()) return Eigen::Vector2d::Zero();
  return 0.5 * (now->low_px + now->high_px - before->low_px - before->high_px);
}

}  // namespace

std::optional<ProjectedBox> projected_box(const CtBox& box_ct,
                                          const RigidTransform& room_from_ct,
                                          const CameraGeometry& camera) {
  constexpr double kLeastDepthMm = 1.0;
  ProjectedBox box{Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity()),
                   Eigen::Vector2d::Constant(-std::numeric_limits<double>::infinity())};
  for (const Eigen::Vector3d& corner : box_ct.corner_points()) {
    const Eigen::Vector3d point = room_from_ct * corner;
    if (!(camera.depth_mm(point) > kLeastDepthMm)) return std::nullopt;
    const Eigen::Vector2d pixel = camera.project(point);
    box.low_px = box.low_px.cwiseMin(pixel);
    box.high_px = box.high_px.cwiseMax(pixel);
  }
  return box;
}

RegionOfInterest target_region_about(const ProjectedBox& box,
                                     const std::optional<RegionOfInterest>& stated,
                                     bool is_nominal_stated) {
  std::optional<PixelRange> stated_columns;
  std::optional<PixelRange> stated_rows;
  if (stated.has_value()) {
    stated_columns = {stated->column, stated->width};
    stated_rows = {stated->row, stated->height};
  }
  const PixelRange columns =
      about_box(box.low_px.x(), box.high_px.x(), stated_columns, is_nominal_stated);
  const PixelRange rows =
      about_box(box.low_px.y(), box.high_px.y(), stated_rows, is_nominal_stated);
  return {columns.first, rows.first, columns.count, rows.count};
}

RegionOfInterest region_at(const RegistrationProblem& problem,
                           const RegistrationView& view,
                           const RigidTransform& room_from_ct,
                           int step_px) {
  if (!view.target_region.has_value()) return view.view.roi;
  const RegionOfInterest& region = *view.target_region;
  const CameraGeometry& camera = view.view.camera;
  const Eigen::Vector2d motion = motion_px(problem, camera, room_from_ct);
  const PixelRange columns =
      moved({region.column, region.width}, motion.x(), step_px, camera.size_px.x());
  const PixelRange rows =
      moved({region.row, region.height}, motion.y(), step_px, camera.size_px.y());
  return {columns.first, rows.first, columns.count, rows.count};
}

std::vector<View> views_at(const RegistrationProblem& problem, const RigidTransform& room_from_ct) {
  std::vector<View> views;
  views.reserve(problem.views.size());
  for (const RegistrationView& view : problem.views)
    views.push_back(View{view.view.camera, region_at(problem, view, room_from_ct)}.scaled(1.0));
  return views;
}

double across_beam_mm(const RegistrationProblem& problem,
                      const std::vector<Eigen::Vector3d>& points_ct,
                      const RigidTransform& from_room_from_ct,
                      const RigidTransform& to_room_from_ct) {
  double most_mm = 0.0;
  for (const RegistrationView& view : problem.views) {
    const CameraGeometry& camera = view.view.camera;
    double sum_px = 0.0;
    for (const Eigen::Vector3d& point : points_ct)
      sum_px +=
          (camera.project(to_room_from_ct * point) - camera.project(from_room_from_ct * point))
              .norm();
    most_mm = std::max(most_mm,
                       sum_px / static_cast<double>(points_ct.size()) /
                           camera.pixels_per_mm(problem.isocenter_point));
  }
  return most_mm;
}

}  // namespace af::registration
