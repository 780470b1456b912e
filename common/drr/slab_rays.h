// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "drr/drr_renderer.h"
#include "geometry/light_slab.h"

namespace af {

/// The rays of a view's region of interest in the slab frame (mm): from `source` along first +
/// column * column_step + row * row_step, column and row counted from the region's corner.
struct SlabRays {
  Eigen::Vector3d source;
  Eigen::Vector3d first;
  Eigen::Vector3d column_step;
  Eigen::Vector3d row_step;
  RegionOfInterest roi;

  SlabRays(const RigidTransform& slab_from_room, const View& view);

  [[nodiscard]] std::array<Eigen::Vector3d, 4> corner_directions() const;
  /// No ray is parallel to the planes or rises from them.
  [[nodiscard]] bool all_descend() const;
  /// The hit points of a view's rays form a convex quadrilateral on each plane, so its corner rays
  /// decide.
  [[nodiscard]] bool all_inside(const LightSlab& light_slab) const;
};

/// Nodes of an (s,t) lattice that a view's rays need, both ends included.
struct Footprint {
  int s_first = 0, s_last = 0;
  int t_first = 0, t_last = 0;

  [[nodiscard]] int s_count() const { return s_last - s_first + 1; }
  [[nodiscard]] int t_count() const { return t_last - t_first + 1; }
};

/// Bounding box of the lattice's nodes around all rays of a view that descend; at least 2 x 2
/// nodes.
Footprint footprint_of(const SlabGeometry& slab, const SlabRays& rays);

/// Zeroes and counts the rays that miss a plane.
std::int64_t blank_rays_outside(const LightSlab& light_slab,
                                const SlabRays& rays,
                                std::span<float> total_attenuation);

}  // namespace af
