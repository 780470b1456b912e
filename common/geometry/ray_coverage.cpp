// SPDX-License-Identifier: Apache-2.0
#include "geometry/ray_coverage.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>
#include <vector>

#include "base/error.h"
#include "geometry/hit_extents.h"
#include "geometry/motion_range.h"

namespace af {

namespace {

bool holds(const GridAxis& x, const GridAxis& z, const PlaneExtent& extent) {
  return x.contains(extent.x_low_mm) && x.contains(extent.x_high_mm) &&
         z.contains(extent.z_low_mm) && z.contains(extent.z_high_mm);
}

/// Tests the corners of the range alone. This is far cheaper than the search, and most boxes that
/// are too large fail here.
bool covers_corners(const LightSlab& light_slab,
                    const CameraGeometry& camera,
                    const PoseFrame& frame,
                    const MotionRange& range) {
  for (unsigned corner = 0; corner < 64; ++corner) {
    const RigidTransform slab_from_room =
        light_slab.slab_from_ct * pose_from_parameters(frame, corner_pose(range, corner)).inverse();
    const Eigen::Vector3d source = slab_from_room * camera.source_point;
    for (const Eigen::Vector3d& detector_corner : camera.detector_corner_points()) {
      const Ray ray{source, slab_from_room * detector_corner - source};
      for (const SlabGeometry& slab : light_slab.slabs)
        if (!light_slab.intersect(ray, slab)) return false;
    }
  }
  return true;
}

}  // namespace

bool covers_range(const LightSlab& light_slab,
                  const CameraGeometry& camera,
                  const PoseFrame& frame,
                  const MotionRange& range) {
  if (!covers_corners(light_slab, camera, frame, range)) return false;
  const double lowest_mm = lowest_source_y_mm(camera, frame, range, light_slab.slab_from_ct);
  for (const SlabGeometry& slab : light_slab.slabs)
    if (!light_slab.lies_before(lowest_mm, slab)) return false;
  std::vector<double> planes = {light_slab.uv_plane_y_mm};
  for (const SlabGeometry& slab : light_slab.slabs) planes.push_back(slab.st_plane_y_mm);
  try {
    const std::vector<PlaneExtent> extents =
        hit_extents(camera, frame, range, planes, light_slab.slab_from_ct);
    if (!holds(light_slab.u, light_slab.v, extents.front())) return false;
    for (std::size_t k = 0; k < light_slab.slabs.size(); ++k)
      if (!holds(light_slab.slabs[k].s, light_slab.slabs[k].t, extents[k + 1])) return false;
    return true;
  } catch (const InputError&) {  // rays parallel to the planes
    return false;
  }
}

MotionRange covered_box(const LightSlab& light_slab,
                        const CameraGeometry& camera,
                        const PoseFrame& frame,
                        const MotionRange& proportion) {
  constexpr double kMostRad = 60.0 * kRadPerDeg;
  constexpr double kMostMm = 1000.0;
  double rotation_rad = proportion.max_rotation_rad();
  double translation_mm = proportion.max_translation_mm();
  if (!(rotation_rad > 0.0) && !(translation_mm > 0.0)) {  // a field for one pose
    rotation_rad = 1.0 * kRadPerDeg;
    translation_mm = 3.0;
  }
  const MotionRange unit(rotation_rad, translation_mm);
  double most = rotation_rad > 0.0 ? kMostRad / rotation_rad : kMostMm / translation_mm;
  if (translation_mm > 0.0) most = std::min(most, kMostMm / translation_mm);
  const auto is_covered = [&](double factor) {
    return covers_range(light_slab, camera, frame, unit.scaled(factor));
  };
  if (!is_covered(0.0)) return {0.0, 0.0};
  if (is_covered(most)) return unit.scaled(most);
  // Larger boxes hold smaller ones, so halving finds the edge. The field's own size comes first,
  // because it is the answer for its own camera.
  double covered = 0.0;
  double uncovered = most;
  for (double next = std::min(1.0, 0.5 * most);; next = 0.5 * (covered + uncovered)) {
    (is_covered(next) ? covered : uncovered) = next;
    if (uncovered - covered <= kCoveredBoxTolerance * uncovered || uncovered < 1e-6) break;
  }
  return unit.scaled(covered);
}

std::string coverage_text(const std::string& camera,
                          std::int64_t rays_inside,
                          std::int64_t rays,
                          const MotionRange& box) {
  const auto rounded_down = [](double value) {
    constexpr double kStep = 0.1;
    constexpr double kRounding = 1e-6;  // 10 degrees are 9.999999 after two conversions
    return kStep * std::floor(value / kStep + kRounding);
  };
  const double share = static_cast<double>(rays_inside) / static_cast<double>(rays);
  std::ostringstream text;
  text << "field covers " << std::fixed << std::setprecision(rays_inside == rays ? 0 : 1)
       << rounded_down(100.0 * share) << " % of camera " << camera << "'s rays ";
  if (rays_inside < rays) {
    text << "at the nominal pose";
  } else {
    text << std::setprecision(1) << "within " << rounded_down(box.max_rotation_rad() * kDegPerRad)
         << " deg / " << rounded_down(box.max_translation_mm()) << " mm of nominal";
  }
  return text.str();
}

}  // namespace af
