// SPDX-License-Identifier: Apache-2.0
#include "register/problem/silhouette_objective.h"

#include <algorithm>
#include <utility>

#include "base/error.h"
#include "register/problem/silhouette.h"

namespace af::registration {
namespace {

/// Gradients reach one pixel beyond a used one.
constexpr int kBorderPx = 1;

/// Where the cuts are seen in a view's region, in its pixels.
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

/// The reference within `region` of it, where `used` and its own mask allow.
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

/// None when too little is seen.
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
  } catch (const InputError&) {  // no contrast that this measure could compare
    return std::nullopt;
  }
  return narrow;
}

}  // namespace

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
