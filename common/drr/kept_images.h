// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>

#include <Eigen/Core>

#include "drr/node_images.h"
#include "drr/slab_rays.h"
#include "drr/viewpoint_blender.h"

namespace af {

/// The node images of a look-up, with their slopes along the source, kept for DRRs whose source is
/// near. For a source that moved by d, the image of a node n is, to first order,
///
///     value(n) + source_x(n) (d_x - m_x d_y) + source_z(n) (d_z - m_z d_y),
///
/// where (m_x, 1, m_z) is the ray's direction: a source that moves along a ray does not change the
/// ray. Two things are left out, and kept small: the second order of how slabs shift against the
/// plane of their sum (nothing for one slab), and viewpoints that come to lie in other cells. \test
/// KeptImages.AreNearTheLookUpWhileTheSourceIsNear
class KeptImages {
 public:
  /// Extra nodes around those that a DRR needs, so that the images also serve DRRs of nearby
  /// sources.
  static constexpr int kMargin = 4;

  void forget() { is_kept_ = false; }
  /// `images` must have slopes, and hold all nodes within kMargin of those that the rays need.
  /// `nodes_per_node`: how many nodes of `images` along an axis make one node of kMargin.
  void keep(const NodeImages& images, int nodes_per_node, const SlabRays& rays);
  /// The motion of the source since the images were made (slab frame, mm). nullopt when the images
  /// cannot serve these rays.
  [[nodiscard]] std::optional<Eigen::Vector3d> source_move(const ViewpointBlender& blender,
                                                           const SlabRays& rays) const;
  [[nodiscard]] const NodeImages& images() const { return images_; }

 private:
  /// Where the rays of a view's corners meet the images' plane, in nodes.
  using Corners = std::array<Eigen::Vector2d, 4>;

  [[nodiscard]] Corners corners_of(const SlabRays& rays) const;

  bool is_kept_ = false;
  NodeImages images_{};
  int nodes_per_node_ = 1;
  Eigen::Vector3d source_ = Eigen::Vector3d::Zero();
  Corners corners_{};
};

}  // namespace af
