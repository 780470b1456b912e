// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "drr/drr_renderer.h"
#include "geometry/light_slab.h"

namespace af {

/// The rays of a view's region of interest in the slab frame (mm). They run from `source` along
/// first + column * column_step + row * row_step, where column and row count from the region's
/// corner. The light slab must outlive them.
struct SlabRays {
  RigidTransform slab_from_room;
  Eigen::Vector3d source;
  Eigen::Vector3d first;
  Eigen::Vector3d column_step;
  Eigen::Vector3d row_step;
  RegionOfInterest roi;

  SlabRays(const LightSlab& light_slab, const RigidTransform& room_from_ct, const View& view);

  [[nodiscard]] std::array<Eigen::Vector3d, 4> corner_directions() const;
  /// Where a ray with this direction meets the plane y = plane_y_mm.
  [[nodiscard]] Eigen::Vector3d hit(double plane_y_mm, const Eigen::Vector3d& direction) const {
    return source + (plane_y_mm - source.y()) / direction.y() * direction;
  }
  /// Whether all rays cross all planes, inside or outside their rectangles. The source must be in
  /// front of all attenuation (LightSlab::lies_before()), no ray may be parallel to the planes or
  /// rise from them, and no number may be NaN or infinite.
  [[nodiscard]] bool all_cross() const;
  /// Whether all rays meet every plane within its rectangle. Their hits form a convex quadrilateral
  /// on each plane, so the corner rays decide.
  [[nodiscard]] bool all_inside() const;
  /// How far the rays keep from the edges of the planes: the least distance of a hit from an edge,
  /// as a share of the plane's side, at most 0.5. It is below 0 when a ray is outside.
  [[nodiscard]] double share_to_edges() const;
  /// The same for each of the axes u, v, s and t, the least over the slabs. All are -1 when a ray
  /// does not cross.
  [[nodiscard]] std::array<double, 4> shares_to_edges() const;
  /// How many rays miss a plane.
  [[nodiscard]] std::int64_t count_outside() const;
  /// Counts the rays that miss a plane, and zeroes their pixels in both outputs. Each output has
  /// any number of planes of the region's pixels.
  [[nodiscard]] std::int64_t blank_outside(std::span<float> planes,
                                           std::span<float> more_planes = {}) const;

 private:
  [[nodiscard]] bool is_inside(const Eigen::Vector3d& direction) const;

  const LightSlab& light_slab_;
};

/// Nodes of an (s,t) lattice that a view's rays need: a quadrilateral and its bounding box.
class Footprint {
 public:
  /// How a renderer reads the nodes.
  struct Needs {
    int margin = 0;            ///< nodes on every side beyond the cells that the rays hit
    bool whole_tiles = false;  ///< the box begins at an even and ends at an odd node; on an odd
                               ///< number of nodes it holds one more than the lattice
  };

  /// Only for rays that cross.
  Footprint(const SlabGeometry& slab, const SlabRays& rays, const Needs& needs);

  /// The box, at least 2 x 2 nodes.
  [[nodiscard]] const NodeRange& s() const { return s_; }
  [[nodiscard]] const NodeRange& t() const { return t_; }
  /// The nodes along t that are needed among nodes s, and likewise for s. May be empty.
  [[nodiscard]] NodeRange t_needed(const NodeRange& s) const;
  [[nodiscard]] NodeRange s_needed(const NodeRange& t) const;

 private:
  /// Where the rays of the region's corners meet the plane, in node coordinates (s, t), in order
  /// around the quadrilateral.
  std::array<std::array<double, 2>, 4> corners_{};
  /// For the side from corner i to the next: change of the other coordinate per coordinate 0 or 1.
  std::array<std::array<double, 2>, 4> side_slopes_{};
  NodeRange s_;
  NodeRange t_;
  int margin_;

  [[nodiscard]] NodeRange needed(const NodeRange& across, std::size_t axis) const;
};

}  // namespace af
