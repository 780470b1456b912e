// SPDX-License-Identifier: Apache-2.0
#include "register/problem/silhouette.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.h"

namespace af::registration {
namespace {

/// Share of the DRR's largest value. It is more than the blur of a level and the quantisation of a
/// field leave beside a body, and less than the thinnest edge of a bone.
constexpr float kLeastShareOfLargest = 0.02f;

/// Pixels as bytes with rows and columns.
struct Pixels {
  std::vector<std::uint8_t>& values;
  int width;
  int height;

  [[nodiscard]] std::uint8_t& at(int column, int row) const {
    return values[static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
                  static_cast<std::size_t>(column)];
  }
  [[nodiscard]] bool is_edge(int column, int row) const {
    return column == 0 || row == 0 || column == width - 1 || row == height - 1 ||
           at(column - 1, row) == 0 || at(column + 1, row) == 0 || at(column, row - 1) == 0 ||
           at(column, row + 1) == 0;
  }
};

void fill_disc(const Pixels& pixels,
               const Eigen::Vector2d& center_px,
               double radius_px,
               std::uint8_t value) {
  // What lies so far outside touches no pixel, and could overflow below.
  if (!center_px.allFinite() || (center_px.array() < -radius_px - 1.0).any() ||
      center_px.x() > pixels.width + radius_px || center_px.y() > pixels.height + radius_px)
    return;
  const auto first = [&](double center) {
    return std::max(0, static_cast<int>(std::ceil(center - radius_px)));
  };
  const auto last = [&](double center, int size) {
    return std::min(size - 1, static_cast<int>(std::floor(center + radius_px)));
  };
  for (int row = first(center_px.y()); row <= last(center_px.y(), pixels.height); ++row)
    for (int column = first(center_px.x()); column <= last(center_px.x(), pixels.width); ++column)
      if ((Eigen::Vector2d(column, row) - center_px).squaredNorm() <= radius_px * radius_px)
        pixels.at(column, row) = value;
}

/// Gradients reach one pixel beyond a used one.
constexpr int kBorderPx = 1;

/// Where the cuts appear in a view's region, in its pixels.
std::vector<Eigen::Vector2d> cuts_in(const View& view,
                                     std::span<const Eigen::Vector3d> cut_points_ct,
                                     const RigidTransform& room_from_ct) {
  const Eigen::Vector2d corner(view.roi.column, view.roi.row);
  std::vector<Eigen::Vector2d> cuts;
  cuts.reserve(cut_points_ct.size());
  for (const Eigen::Vector3d& point : cut_points_ct)
    cuts.emplace_back(view.camera.project(room_from_ct * point) - corner);
  return cuts;
}

/// The part of the reference within `region`, where `used` and its own mask allow.
SimilarityReference narrowed(const SimilarityReference& reference,
                             std::span<const std::uint8_t> used,
                             const RegionOfInterest& region) {
  SimilarityReference result;
  result.xray = crop(reference.xray, region);
  result.drr_range = reference.drr_range;
  result.used.reserve(region.pixel_count());
  for (int row = region.row; row < region.row + region.height; ++row)
    for (int column = region.column; column < region.column + region.width; ++column) {
      const std::size_t at =
          static_cast<std::size_t>(row) * static_cast<std::size_t>(reference.xray.width) +
          static_cast<std::size_t>(column);
      result.used.push_back(
          static_cast<std::uint8_t>(used[at] != 0 && reference.is_used(at) ? 1 : 0));
    }
  return result;
}

/// None when too little is visible.
std::optional<ObjectiveView> narrowed_view(const SilhouetteView& view,
                                           std::span<const Eigen::Vector3d> cut_points_ct,
                                           const RigidTransform& room_from_ct) {
  const View& whole = view.whole.view;
  const Image2d drr = render_image(*view.sharpest, room_from_ct, whole);
  const std::vector<std::uint8_t> used =
      silhouette(drr, view.margin_px, cuts_in(whole, cut_points_ct, room_from_ct));
  const RegionOfInterest region = region_of(used, drr.width, drr.height, kBorderPx);
  if (region.pixel_count() == 0) return std::nullopt;
  const SimilarityReference reference = narrowed(view.reference, used, region);
  const auto count =
      static_cast<std::size_t>(std::count(reference.used.begin(), reference.used.end(), 1));
  if (count < kLeastSilhouettePixels || !problems(reference).empty()) return std::nullopt;
  ObjectiveView narrow = view.whole;
  narrow.view.roi = {
      whole.roi.column + region.column, whole.roi.row + region.row, region.width, region.height};
  try {
    narrow.measure = make_similarity(view.similarity, reference);
  } catch (const InputError&) {  // there is no contrast that this measure could compare
    return std::nullopt;
  }
  return narrow;
}

}  // namespace

std::vector<std::uint8_t> silhouette(const Image2d& drr,
                                     double margin_px,
                                     std::span<const Eigen::Vector2d> cuts_px) {
  check(margin_px >= 0.0, "a silhouette is not shrunk");
  std::vector<std::uint8_t> body(drr.pixels.size(), 0);
  if (drr.pixels.empty()) return body;
  const float least =
      kLeastShareOfLargest * *std::max_element(drr.pixels.begin(), drr.pixels.end());
  for (std::size_t i = 0; i < body.size(); ++i)
    body[i] = static_cast<std::uint8_t>(drr.pixels[i] > std::max(0.0f, least) ? 1 : 0);
  std::vector<std::uint8_t> grown = body;
  const Pixels from{body, drr.width, drr.height};
  const Pixels to{grown, drr.width, drr.height};
  for (int row = 0; row < drr.height; ++row)
    for (int column = 0; column < drr.width; ++column)
      if (from.at(column, row) != 0 && from.is_edge(column, row))
        fill_disc(to, Eigen::Vector2d(column, row), margin_px, 1);
  for (const Eigen::Vector2d& cut : cuts_px) fill_disc(to, cut, margin_px, 0);
  return grown;
}

RegionOfInterest region_of(std::span<const std::uint8_t> used, int width, int height, int border) {
  int left = width;
  int right = -1;
  int top = height;
  int bottom = -1;
  for (int row = 0; row < height; ++row)
    for (int column = 0; column < width; ++column) {
      if (used[static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
               static_cast<std::size_t>(column)] == 0)
        continue;
      left = std::min(left, column);
      right = std::max(right, column);
      top = std::min(top, row);
      bottom = std::max(bottom, row);
    }
  if (right < 0) return {};
  left = std::max(0, left - border);
  top = std::max(0, top - border);
  right = std::min(width - 1, right + border);
  bottom = std::min(height - 1, bottom + border);
  return {left, top, right - left + 1, bottom - top + 1};
}

std::optional<MultiViewObjective> silhouette_objective(
    std::span<const SilhouetteView> views,
    std::span<const Eigen::Vector3d> cut_points_ct,
    const RigidTransform& room_from_ct,
    const std::shared_ptr<ThreadPool>& pool) {
  std::vector<ObjectiveView> narrow;
  for (const SilhouetteView& view : views) {
    auto narrowed = narrowed_view(view, cut_points_ct, room_from_ct);
    if (!narrowed.has_value()) return std::nullopt;
    narrow.push_back(std::move(*narrowed));
  }
  return MultiViewObjective(std::move(narrow), pool);
}

}  // namespace af::registration
