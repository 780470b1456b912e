// SPDX-License-Identifier: Apache-2.0
#include "simulation/phantom_parts.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.h"
#include "geometry/rigid_transform.h"

namespace af {

namespace {

using Eigen::Vector3d;

void add_arch(const Vertebra& v, BonePainter& bone) {
  const double back = v.half_depth_mm;
  for (const double side : {-1.0, 1.0}) {
    const auto at = [&](double x, double y, double z) {
      return Vector3d(v.center + Vector3d(side * x, y, z));
    };
    bone.add_capsule(at(12.0, back - 4.0, 4.0), at(13.5, back + 9.0, 3.0), 4.5);      // pedicle
    bone.add_capsule(at(13.5, back + 11.0, 1.0), at(3.0, back + 19.0, -5.0), 3.8);    // lamina
    bone.add_capsule(at(14.0, back + 9.0, 16.0), at(14.5, back + 12.0, -15.0), 4.2);  // articular
    const double reach = v.has_ribs() ? 28.0 - v.level : 38.0;
    bone.add_capsule(
        at(14.0, back + 9.0, 3.0), at(reach, back + (v.has_ribs() ? 15.0 : 9.0), 5.0), 3.6);
  }
}

void add_spinous_process(const Vertebra& v, BonePainter& bone) {
  // Long and steep on thoracic, broad and level on lumbar vertebrae.
  const double drop_mm = v.has_ribs() ? 16.0 : 7.0;
  const Vector3d root = v.center + Vector3d(0.0, v.half_depth_mm + 17.0, -5.0);
  const Vector3d tip = root + Vector3d(1.0, 25.0, -drop_mm);
  Solid blade = ellipsoid(0.5 * (root + tip),
                          {3.4, 0.5 * (tip - root).norm() + 3.0, v.has_ribs() ? 6.0 : 9.0},
                          kCorticalHu);
  blade.rotation = rotation_between(Vector3d::UnitY(), tip - root);
  bone.add(blade);
}

}  // namespace

void PhantomOptions::describe(Fields& field) {
  field("phantom_voxel_mm", voxel_mm, "Voxel side of the phantom, mm").within(0.5, 5.0);
  const char* const why = "all studies have one";
  field("samples_per_axis", samples_per_axis, "Points per voxel and axis")
      .within(1, 8)
      .no_option(why)
      .not_recorded(why);
  field.leave_out(threads, "voxels do not depend on it");
  field("metal",
        has_metal,
        "Phantoms only: with pedicle screws and rods (spine), a hip prosthesis (pelvis) or "
        "fillings and a plate (head). The X-rays show metal as dense as it is, the CT clips it at "
        "3071 HU as scanners do");
}

std::vector<std::string> problems(const PhantomOptions& options) {
  return field_problems(options);
}

CtVolume sample_phantom(const Phantom& phantom, const PhantomOptions& options) {
  throw_if_any(problems(options));
  CtGrid grid;
  for (Eigen::Index axis = 0; axis < 3; ++axis)
    grid.size[static_cast<std::size_t>(axis)] =
        static_cast<int>(std::lround(2.0 * phantom.half_sizes_mm[axis] / options.voxel_mm));
  grid.spacing_mm = Vector3d::Constant(options.voxel_mm);
  grid.origin_mm =
      -0.5 * options.voxel_mm * Vector3d(grid.size[0] - 1, grid.size[1] - 1, grid.size[2] - 1);
  return sample_solids(grid, phantom.solids, options.samples_per_axis, options.threads);
}

CtVolume with_scanner_range(const CtVolume& ct) {
  constexpr std::int16_t kHighestHu = 3071;
  std::vector<std::int16_t> voxels(ct.hu.view().begin(), ct.hu.view().end());
  for (std::int16_t& hu : voxels) hu = std::min(hu, kHighestHu);
  return {ct.grid, SharedArray<std::int16_t>(std::move(voxels))};
}

Solid ellipsoid(const Vector3d& center, const Vector3d& half_sizes, int hu, int texture_hu) {
  Solid solid;
  solid.center_mm = center;
  solid.half_sizes_mm = half_sizes;
  solid.hu = hu;
  solid.texture_hu = texture_hu;
  return solid;
}

Solid elliptic_cylinder(const Vector3d& center, const Vector3d& half_sizes, int hu) {
  Solid solid = ellipsoid(center, half_sizes, hu);
  solid.shape = Solid::Shape::EllipticCylinder;
  return solid;
}

Vector3d mirrored(const Vector3d& point, double side) {
  return {side * point.x(), point.y(), point.z()};
}

void BonePainter::add(Solid part) {
  constexpr int kCancellousTextureHu = 110;
  part.hu = kCorticalHu;
  solids_.push_back(part);
  part.half_sizes_mm -= Vector3d::Constant(shell_mm_);
  if (part.shape == Solid::Shape::Capsule) part.half_sizes_mm.z() += shell_mm_;
  if (!(part.half_sizes_mm.minCoeff() > 0.0)) return;
  part.hu = kCancellousHu;
  part.texture_hu = kCancellousTextureHu;
  cores_.push_back(part);
}

void BonePainter::add_capsule(const Vector3d& a, const Vector3d& b, double radius_mm) {
  add(capsule_between(a, b, radius_mm, kCorticalHu));
}

void BonePainter::add_chain(const std::vector<Vector3d>& points, double radius_mm) {
  for (std::size_t i = 1; i < points.size(); ++i) add_capsule(points[i - 1], points[i], radius_mm);
}

void add_vertebra(const Vertebra& v, std::vector<Solid>& solids) {
  BonePainter bone(solids);
  Solid body = elliptic_cylinder(
      v.center, {v.half_width_mm, v.half_depth_mm, v.half_height_mm}, kCorticalHu);
  body.waist = 0.1;
  bone.add(body);
  add_arch(v, bone);
  add_spinous_process(v, bone);
}

}  // namespace af
