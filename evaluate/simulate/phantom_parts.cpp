// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/phantom_parts.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/SVD>

#include "base/error.h"
#include "base/hash_random.h"
#include "geometry/rigid_transform.h"

namespace af {

namespace {

using Eigen::Vector3d;

constexpr std::int16_t kScannersHighestHu = 3071;

void add_arch(const Vertebra& v, BonePainter& bone) {
  const double back = v.half_depth_mm;
  for (const double side : {-1.0, 1.0}) {
    const auto at = [&](double x, double y, double z) {
      return Vector3d(v.center + Vector3d(side * x, y, z));
    };
    bone.add_capsule(at(12.0, back - 4.0, 4.0), at(13.5, back + 9.0, 3.0), 4.5);    // pedicle
    bone.add_capsule(at(13.5, back + 11.0, 1.0), at(3.0, back + 19.0, -5.0), 3.8);  // lamina
    bone.add_capsule(at(14.0, back + 9.0, 16.0),
                     at(14.5, back + 12.0, -15.0),
                     4.2 * v.facets);  // articular
    const double reach = v.processes * (v.has_ribs() ? 28.0 - v.level : 38.0);
    bone.add_capsule(
        at(14.0, back + 9.0, 3.0), at(reach, back + (v.has_ribs() ? 15.0 : 9.0), 5.0), 3.6);
  }
}

void add_spinous_process(const Vertebra& v, BonePainter& bone) {
  // The process is long and steep on thoracic vertebrae, broad and level on lumbar ones.
  const double drop_mm = v.has_ribs() ? 16.0 : 7.0;
  const Vector3d root = v.center + Vector3d(0.0, v.half_depth_mm + 17.0, -5.0);
  const Vector3d tip = root + Vector3d(1.0 + v.tilt_mm, 25.0 * v.processes, -drop_mm * v.processes);
  Solid blade = ellipsoid(0.5 * (root + tip),
                          {3.4, 0.5 * (tip - root).norm() + 3.0, v.has_ribs() ? 6.0 : 9.0},
                          kCorticalHu);
  blade.rotation = rotation_between(Vector3d::UnitY(), tip - root);
  bone.add(blade);
}

/// Beaks of bone at the front and side rims, and dense end plates.
void add_osteophytes(const Vertebra& v, BonePainter& bone, std::vector<Solid>& solids) {
  constexpr int kBeaks = 9;
  constexpr double kSpreadRad = 2.2;  // to both sides of the front
  HashRandom random(v.beaks);
  for (const double end : {-1.0, 1.0}) {
    for (int i = 0; i < kBeaks; ++i) {
      const double angle = kSpreadRad * (2.0 * (i + random.uniform()) / kBeaks - 1.0);
      const double length_mm = v.arthrosis * random.uniform(0.0, 9.0);
      const double radius_mm = random.uniform(1.6, 2.6);
      if (length_mm < 2.0) continue;
      const Vector3d outwards(std::sin(angle), -std::cos(angle), 0.0);
      const Vector3d rim =
          v.center + Vector3d(v.half_width_mm * outwards.x(), v.half_depth_mm * outwards.y(), 0.0) -
          radius_mm * outwards + Vector3d(0.0, 0.0, end * (v.half_height_mm - radius_mm));
      bone.add_chain(
          {rim,
           rim + length_mm * outwards,
           rim + (length_mm + 1.0) * outwards + Vector3d(0.0, 0.0, end * length_mm * 0.5)},
          radius_mm);
    }
    solids.push_back(elliptic_cylinder(v.center + Vector3d(0.0, 0.0, end * v.half_height_mm),
                                       {0.93 * v.half_width_mm, 0.93 * v.half_depth_mm, 1.2},
                                       kCorticalHu));
  }
}

/// The density of a body's tissue in the patient's bones.
int patients_hu(int hu, double cortical, double cancellous) {
  constexpr int kLowestBoneHu = 150;
  constexpr int kLowestCorticalHu = 400;
  constexpr int kLowestToothHu = 1180;
  if (hu < kLowestBoneHu || hu >= kLowestToothHu) return hu;
  const double share = hu < kLowestCorticalHu ? cancellous : cortical;
  return kMuscleHu + static_cast<int>(std::lround(share * (hu - kMuscleHu)));
}

Solid shaped(Solid solid, const Habitus& habitus) {
  if (solid.shape == Solid::Shape::Capsule && solid.half_sizes_mm.z() > 0.0) {
    const Vector3d half = solid.half_sizes_mm.z() * solid.rotation.col(2);
    const Eigen::Matrix3d jacobian = habitus.jacobian(solid.center_mm);
    const double across = std::sqrt(
        (jacobian * solid.rotation.col(0)).cross(jacobian * solid.rotation.col(1)).norm());
    const Solid moved = capsule_between(habitus(solid.center_mm - half),
                                        habitus(solid.center_mm + half),
                                        across * solid.half_sizes_mm.x(),
                                        solid.hu);
    solid.center_mm = moved.center_mm;
    solid.half_sizes_mm = moved.half_sizes_mm;
    solid.rotation = moved.rotation;
    return solid;
  }
  const Eigen::Matrix3d axes = habitus.jacobian(solid.center_mm) * solid.rotation;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(axes, Eigen::ComputeFullU | Eigen::ComputeFullV);
  solid.center_mm = habitus(solid.center_mm);
  solid.half_sizes_mm = solid.half_sizes_mm.cwiseProduct(axes.colwise().norm().transpose());
  solid.rotation = svd.matrixU() * svd.matrixV().transpose();
  return solid;
}

/// The target at the patient's place, as large as before.
RegistrationTarget shaped(const RegistrationTarget& target, const Habitus& habitus) {
  const CtBox& box = target.box_ct;
  const Vector3d half = 0.5 * (box.high_mm - box.low_mm);
  const Vector3d middle = habitus(0.5 * (box.high_mm + box.low_mm));
  return {habitus(target.center_ct_mm), {middle - half, middle + half}};
}

}  // namespace

bool Phantom::has_metal() const {
  return std::any_of(solids.begin(), solids.end(), [](const Solid& solid) {
    return solid.hu > kScannersHighestHu;
  });
}

Phantom shaped(Phantom phantom, const Anatomy& anatomy, const Habitus& habitus) {
  if (anatomy.is_typical()) return phantom;
  const double cortical = anatomy.between("cortical bone", 0.75, 1.15, 1.0);
  const double cancellous = anatomy.between("cancellous bone", 0.35, 1.45, 1.0);
  const double grain_mm = anatomy.between("trabecular scale", 2.0, 4.0, 3.0);
  // The shift is large enough for every patient to have a texture of its own.
  const Vector3d grain_shift_mm = anatomy.shift3("texture", 1e5);
  for (Solid& solid : phantom.solids) {
    solid = shaped(solid, habitus);
    solid.hu = patients_hu(solid.hu, cortical, cancellous);
    solid.texture_scale_mm = grain_mm;
    solid.texture_shift_mm = grain_shift_mm;
  }
  const Vector3d room_mm = Vector3d(1.0, 1.0, 0.0) * std::max(0.0, anatomy.fat_mm());
  phantom.half_sizes_mm = phantom.half_sizes_mm.cwiseProduct(habitus.stretch()) + room_mm;
  phantom.target = shaped(phantom.target, habitus);
  for (PhantomBone& bone : phantom.bones) bone.target = shaped(bone.target, habitus);
  if (cancellous < 0.65) phantom.findings.emplace_back("thin bone");
  if (anatomy.arthrosis() > 0.3) phantom.findings.emplace_back("arthrosis");
  if (habitus.cobb_deg() >= 10.0)
    phantom.findings.push_back("scoliosis of " + std::to_string(std::lround(habitus.cobb_deg())) +
                               " deg");
  return phantom;
}

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
        "Phantoms only: with screws and rods (spine), a hip prosthesis (pelvis), or fillings and a "
        "plate (head), which the CT clips at 3071 HU");
  field("anatomy_seed",
        anatomy_seed,
        "Phantoms only: every number is another patient, whose X-rays are line integrals of the "
        "bodies themselves. Default: the typical adult, X-rays of the voxels")
      .at_least(0);
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
  std::vector<std::int16_t> voxels(ct.hu.view().begin(), ct.hu.view().end());
  for (std::int16_t& hu : voxels) hu = std::min(hu, kScannersHighestHu);
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

void give_to_bone(std::string_view bone, std::vector<Solid>& solids, std::size_t first) {
  for (std::size_t i = first; i < solids.size(); ++i) solids[i].bone = bone;
}

void add_gas(const Anatomy& anatomy, const CtBox& box, std::vector<Solid>& solids) {
  const int bubbles = static_cast<int>(anatomy.between("gas", 0.0, 14.0, 0.0));
  for (int i = 0; i < bubbles; ++i) {
    Vector3d share;
    for (int axis = 0; axis < 3; ++axis)
      share[axis] = anatomy.between("bubble", 0.0, 1.0, 0.5, 3 * i + axis);
    const double size_mm = anatomy.between("bubble size", 4.0, 14.0, 4.0, i);
    solids.push_back(
        ellipsoid(box.low_mm + share.cwiseProduct(box.high_mm - box.low_mm),
                  size_mm * (Vector3d::Ones() + anatomy.shift3("bubble shape", 0.2, i)),
                  kGasHu));
  }
}

void add_vertebra(const Vertebra& v, std::vector<Solid>& solids) {
  BonePainter bone(solids, v.shell_mm);
  Solid body = elliptic_cylinder(
      v.center, {v.half_width_mm, v.half_depth_mm, v.half_height_mm}, kCorticalHu);
  body.waist = 0.1;
  bone.add(body);
  add_arch(v, bone);
  add_spinous_process(v, bone);
  if (v.arthrosis > 0.0) add_osteophytes(v, bone, solids);
}

Vertebra varied(Vertebra v, const Anatomy& anatomy, int index) {
  if (anatomy.is_typical()) return v;
  const double size = anatomy.factor("vertebrae", 0.05);
  v.half_width_mm *= size * anatomy.factor("vertebra width", 0.04, index);
  v.half_depth_mm *= size * anatomy.factor("vertebra depth", 0.04, index);
  v.half_height_mm *=
      anatomy.factor("vertebrae's height", 0.04) * anatomy.factor("vertebra height", 0.03, index);
  v.center += anatomy.shift3("vertebra place", 0.7, index);
  v.shell_mm *= anatomy.shell();
  v.processes = anatomy.factor("processes", 0.08) * anatomy.factor("process", 0.06, index);
  v.tilt_mm = anatomy.shift("spinous tilt", 2.0, index);
  // Some levels wear more than others.
  v.arthrosis = anatomy.arthrosis() * anatomy.between("wear", 0.3, 1.0, 0.0, index);
  v.facets = 1.0 + 0.5 * v.arthrosis;
  v.beaks = static_cast<std::uint64_t>(anatomy.between("beaks", 0.0, 1e15, 0.0, index));
  return v;
}

}  // namespace af
