// SPDX-License-Identifier: Apache-2.0
#include "drr/kept_images.h"

#include <algorithm>
#include <cmath>

namespace af {
namespace {

/// Most parallax, in nodes of a slab, that kept images follow to first order. At half a node, their
/// values exceeded those of new images by so much that searches refused later steps, which used new
/// images (docs/look-up.md). \test KeptImages.ServeNoPoseThatShiftsASlabByMoreThanAnEighthOfANode
constexpr double kMostParallaxNodes = 0.125;

/// Share of a (u,v) cell by which viewpoints may move.
constexpr double kMostViewpointShare = 0.25;

/// How far the hits on a plane move per mm that the source moves, while those on the images' plane
/// stay.
double hits_per_mm(double plane_y_mm, double images_y_mm, double source_y_mm) {
  return std::abs((plane_y_mm - images_y_mm) / (source_y_mm - images_y_mm));
}

}  // namespace

void KeptImages::keep(const NodeImages& images, int nodes_per_node, const SlabRays& rays) {
  images_ = images;
  nodes_per_node_ = nodes_per_node;
  source_ = rays.source;
  corners_ = corners_of(rays);
  is_kept_ = true;
}

KeptImages::Corners KeptImages::corners_of(const SlabRays& rays) const {
  const NodeGrid& grid = images_.grid;
  const auto directions = rays.corner_directions();
  Corners corners;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Eigen::Vector3d hit = rays.hit(grid.plane_y_mm, directions[i]);
    corners[i] = {(hit.x() - grid.s_first_mm) / grid.s_spacing_mm,
                  (hit.z() - grid.t_first_mm) / grid.t_spacing_mm};
  }
  return corners;
}

std::optional<Eigen::Vector3d> KeptImages::source_move(const ViewpointBlender& blender,
                                                       const SlabRays& rays) const {
  if (!is_kept_) return std::nullopt;
  const Eigen::Vector3d move = rays.source - source_;
  const double way_mm = move.norm();
  const double images_y_mm = images_.grid.plane_y_mm;
  const LightSlab& field = blender.field_geometry();
  const double viewpoints_mm = way_mm * hits_per_mm(field.uv_plane_y_mm, images_y_mm, source_.y());
  if (viewpoints_mm > kMostViewpointShare * std::min(field.u.spacing_mm(), field.v.spacing_mm()))
    return std::nullopt;
  for (std::size_t k = 0; k < blender.slab_count(); ++k) {
    const SlabGeometry& slab = blender.slab(k);
    const double shift_mm = way_mm * hits_per_mm(slab.st_plane_y_mm, images_y_mm, source_.y());
    if (shift_mm > kMostParallaxNodes * std::min(slab.s.spacing_mm(), slab.t.spacing_mm()))
      return std::nullopt;
  }
  const Corners corners = corners_of(rays);
  for (std::size_t i = 0; i < corners.size(); ++i)
    if ((corners[i] - corners_[i]).cwiseAbs().maxCoeff() > kMargin * nodes_per_node_)
      return std::nullopt;
  return move;
}

}  // namespace af
