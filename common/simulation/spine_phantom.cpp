// SPDX-License-Identifier: Apache-2.0
#include "simulation/spine_phantom.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "base/error.h"

namespace af {

namespace {

using Eigen::Vector3d;

constexpr double kWidthMm = 358.0;  // left-right and front-back
constexpr double kHeightMm = 280.0;
constexpr double kPitchMm = 33.0;         // between vertebrae
constexpr int kVertebraeEachSide = 4;     // vertebrae below and above T12
constexpr double kTorsoFrontMm = -115.0;  // skin, y
constexpr double kTorsoBackMm = 78.0;
constexpr double kTorsoHalfWidthMm = 143.0;
constexpr double kTorsoMiddleMm = 0.5 * (kTorsoFrontMm + kTorsoBackMm);
constexpr double kTorsoHalfDepthMm = 0.5 * (kTorsoBackMm - kTorsoFrontMm);

constexpr int kOrganHu = 60;
constexpr int kLungHu = -830;
constexpr int kDiscHu = 90;
constexpr int kCanalHu = 20;

/// The curve of the spine: kyphosis above, lordosis below, a slight bend to the left.
Vector3d spine_point(double z_mm) {
  return {3.5 * std::sin(z_mm / 70.0), 6.0 * std::sin(z_mm / 95.0), z_mm};
}

Vertebra vertebra_at(int level) {
  return {level,
          spine_point(level * kPitchMm),
          20.0 - 1.1 * level,
          15.0 - 0.5 * level,
          0.5 * (25.5 - 0.7 * level)};
}

void add_disc(int level_below, std::vector<Solid>& solids) {
  const Vertebra below = vertebra_at(level_below);
  const Vertebra above = vertebra_at(level_below + 1);
  solids.push_back(
      elliptic_cylinder(0.5 * (below.center + above.center),
                        {below.half_width_mm - 0.5, below.half_depth_mm - 0.5, 0.5 * kPitchMm},
                        kDiscHu));
}

void add_canal(std::vector<Solid>& solids) {
  for (int level = -kVertebraeEachSide - 1; level <= kVertebraeEachSide + 1; ++level) {
    const Vertebra v = vertebra_at(level);
    solids.push_back(elliptic_cylinder(v.center + Vector3d(0.0, v.half_depth_mm + 8.0, 0.0),
                                       {9.0, 7.5, 0.5 * kPitchMm},
                                       kCanalHu));
  }
}

/// Points along a rib: head at the body, tubercle at the transverse process, then around the
/// chest wall and down.
std::vector<Vector3d> rib_points(const Vertebra& v, double side) {
  constexpr double kDegree = std::numbers::pi / 180.0;
  constexpr int kArcPoints = 24;
  const bool is_floating = v.level == 0;
  const double end_deg = is_floating ? 85.0 : std::min(150.0, 110.0 + 12.0 * v.level);
  const double total_drop_mm = is_floating ? 45.0 : 75.0;
  // The spine sits deeper than the chest wall's back: the ribs first run backwards, then around.
  const double half_width = kTorsoHalfWidthMm - 23.0 - 3.0 * (v.level == 4 ? 1 : 0);
  const double half_depth = kTorsoHalfDepthMm - 20.0;
  std::vector<Vector3d> points{
      v.center + Vector3d(side * (v.half_width_mm + 1.0), v.half_depth_mm - 3.0, 8.0),
      v.center + Vector3d(side * (28.0 - v.level), v.half_depth_mm + 13.0, 9.0)};
  constexpr double kStartDeg = 24.0;
  for (int i = 0; i <= kArcPoints; ++i) {
    const double share = static_cast<double>(i) / kArcPoints;
    const double angle = (kStartDeg + share * (end_deg - kStartDeg)) * kDegree;
    const double drop = total_drop_mm * (0.15 * share + 0.85 * share * share) - 4.0;
    points.emplace_back(side * half_width * std::sin(angle),
                        kTorsoMiddleMm + half_depth * std::cos(angle),
                        v.center.z() - drop);
  }
  return points;
}

void add_ribs(std::vector<Solid>& solids) {
  for (int level = 0; level <= kVertebraeEachSide + 2; ++level)
    for (const double side : {-1.0, 1.0}) {
      BonePainter bone(solids);
      const std::vector<Vector3d> points = rib_points(vertebra_at(level), side);
      for (std::size_t i = 1; i < points.size(); ++i)
        bone.add_capsule(points[i - 1], points[i], i < 2 ? 4.0 : 5.0);
    }
}

void add_soft_tissue(std::vector<Solid>& solids) {
  const Vector3d middle(0.0, kTorsoMiddleMm, 0.0);
  solids.push_back(
      elliptic_cylinder(middle, {kTorsoHalfWidthMm, kTorsoHalfDepthMm, kHeightMm}, kFatHu));
  solids.push_back(elliptic_cylinder(
      middle, {kTorsoHalfWidthMm - 12.0, kTorsoHalfDepthMm - 9.0, kHeightMm}, kMuscleHu));
  // Fat between the organs, in front of the spine.
  solids.push_back(ellipsoid({0.0, -58.0, -70.0}, {106.0, 44.0, 140.0}, -60, 40));
  // Lung bases reach down beside T11; the left one is narrower for the heart.
  solids.push_back(ellipsoid({-63.0, -14.0, 150.0}, {49.0, 60.0, 120.0}, kLungHu, 60));
  solids.push_back(ellipsoid({65.0, -12.0, 150.0}, {46.0, 58.0, 128.0}, kLungHu, 60));
  solids.push_back(ellipsoid({22.0, -52.0, 120.0}, {48.0, 38.0, 62.0}, kMuscleHu));   // heart
  solids.push_back(ellipsoid({-56.0, -38.0, 8.0}, {66.0, 58.0, 52.0}, kOrganHu, 8));  // liver
  solids.push_back(ellipsoid({84.0, 6.0, 22.0}, {27.0, 34.0, 34.0}, kOrganHu, 8));    // spleen
  solids.push_back(ellipsoid({52.0, -58.0, 2.0}, {42.0, 34.0, 36.0}, 35));            // stomach
  solids.push_back(ellipsoid({58.0, -72.0, 10.0}, {26.0, 15.0, 20.0}, kGasHu));
  solids.push_back(ellipsoid({76.0, -50.0, -78.0}, {16.0, 18.0, 34.0}, 30));  // colon
  solids.push_back(ellipsoid({78.0, -56.0, -70.0}, {10.0, 9.0, 19.0}, kGasHu));
  solids.push_back(ellipsoid({-58.0, 18.0, -52.0}, {26.0, 22.0, 50.0}, 35));  // kidneys
  solids.push_back(ellipsoid({60.0, 18.0, -38.0}, {26.0, 22.0, 50.0}, 35));
  solids.push_back(elliptic_cylinder({13.0, -27.0, 0.0}, {11.0, 11.0, kHeightMm}, 45));  // aorta
}

/// Pedicle screws from T11 to L1 and a rod on each side.
void add_screws_and_rods(std::vector<Solid>& solids) {
  constexpr double kScrewRadiusMm = 2.8;
  constexpr double kHeadRadiusMm = 5.0;
  for (const double side : {-1.0, 1.0}) {
    std::vector<Vector3d> heads;
    for (int level = -1; level <= 1; ++level) {
      const Vertebra v = vertebra_at(level);
      const Vector3d tip = v.center + Vector3d(side * 8.0, -0.4 * v.half_depth_mm, 3.0);
      const Vector3d head = v.center + Vector3d(side * 17.0, v.half_depth_mm + 22.0, 3.0);
      solids.push_back(capsule_between(tip, head, kScrewRadiusMm, kTitaniumHu));
      solids.push_back(ellipsoid(head, Vector3d::Constant(kHeadRadiusMm), kTitaniumHu));
      heads.push_back(head);
    }
    solids.push_back(capsule_between(heads.front(), heads.back(), kScrewRadiusMm, kTitaniumHu));
  }
}

}  // namespace

std::vector<Solid> spine_phantom_solids(bool has_metal) {
  std::vector<Solid> solids;
  add_soft_tissue(solids);
  add_ribs(solids);
  // One more vertebra at each end: the volume cuts through them, as a scan does.
  for (int level = -kVertebraeEachSide - 1; level <= kVertebraeEachSide; ++level)
    add_disc(level, solids);
  for (int level = -kVertebraeEachSide - 1; level <= kVertebraeEachSide + 1; ++level)
    add_vertebra(vertebra_at(level), solids);
  add_canal(solids);
  if (has_metal) add_screws_and_rods(solids);
  return solids;
}

Phantom spine_phantom(bool has_metal) {
  return {spine_phantom_solids(has_metal),
          0.5 * Vector3d(kWidthMm, kWidthMm, kHeightMm),
          spine_phantom_target()};
}

RegistrationTarget spine_phantom_target() {
  const Vertebra middle = vertebra_at(0);
  const Vector3d half(middle.half_width_mm + 4.0, middle.half_depth_mm + 8.0, 18.0);
  const Vector3d center = middle.center + Vector3d(0.0, 6.0, 0.0);
  return {center, {center - half, center + half}};
}

std::vector<Vector3d> spine_phantom_vertebra_centers() {
  std::vector<Vector3d> centers;
  for (int level = -kVertebraeEachSide; level <= kVertebraeEachSide; ++level)
    centers.push_back(vertebra_at(level).center);
  return centers;
}

}  // namespace af
