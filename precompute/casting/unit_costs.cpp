// SPDX-License-Identifier: Apache-2.0
#include "precompute/casting/unit_costs.h"

#include <algorithm>

#include <Eigen/Geometry>

namespace af {

namespace {

/// The part of nodes [range.begin, range.end()) that lies in [low, high].
double covered_fraction(const NodeRange& range, double low, double high) {
  const double covered = std::min<double>(high, range.end()) - std::max<double>(low, range.begin);
  return std::clamp(covered / range.count, 0.0, 1.0);
}

/// The part of a unit's nodes that the box's shadow covers, as seen from one viewpoint.
double shadow_fraction(const WorkUnit& unit,
                       const SlabGeometry& slab,
                       const Eigen::Vector3d& viewpoint,
                       const Eigen::AlignedBox3d& box) {
  Eigen::AlignedBox2d nodes;
  for (const double x : {box.min().x(), box.max().x()})
    for (const double y : {box.min().y(), box.max().y()})
      for (const double z : {box.min().z(), box.max().z()}) {
        const double scale = (slab.st_plane_y_mm - viewpoint.y()) / (y - viewpoint.y());
        const Eigen::Vector3d hit = viewpoint + scale * (Eigen::Vector3d(x, y, z) - viewpoint);
        nodes.extend(
            Eigen::Vector2d(slab.s.node_coordinate(hit.x()), slab.t.node_coordinate(hit.z())));
      }
  return covered_fraction(unit.s, nodes.min().x(), nodes.max().x()) *
         covered_fraction(unit.t, nodes.min().y(), nodes.max().y());
}

double unit_cost(const WorkUnit& unit,
                 const LightSlab& light_slab,
                 const Eigen::AlignedBox3d& all) {
  const SlabGeometry& slab = light_slab.slabs[unit.slab];
  Eigen::AlignedBox3d box = all;
  box.min().y() = std::max(box.min().y(), slab.y_low_mm);
  box.max().y() = std::min(box.max().y(), slab.y_high_mm);
  double covered = 0.0;
  for (const int u : {unit.u.begin, unit.u.begin + unit.u.count / 2, unit.u.end() - 1})
    for (const int v : {unit.v.begin, unit.v.end() - 1})
      covered += shadow_fraction(unit, slab, light_slab.viewpoint(u, v), box) / 6.0;
  const double depth = std::max(0.0, box.sizes().y()) / all.sizes().y();
  constexpr double kCostOfEmptyRay = 0.05;
  return static_cast<double>(unit.sample_count()) * (kCostOfEmptyRay + covered * depth);
}

}  // namespace

std::vector<double> unit_costs(const std::vector<WorkUnit>& units,
                               const LightSlab& light_slab,
                               const std::array<Eigen::Vector3d, 8>& attenuating_corners_ct) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& corner : attenuating_corners_ct)
    box.extend(light_slab.slab_from_ct * corner);
  std::vector<double> costs;
  costs.reserve(units.size());
  for (const WorkUnit& unit : units) costs.push_back(unit_cost(unit, light_slab, box));
  return costs;
}

}  // namespace af
