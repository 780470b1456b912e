// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/pelvis_phantom.h"

#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "geometry/rigid_transform.h"

namespace af {

namespace {

using Eigen::Vector3d;

constexpr std::string_view kLeftFemur = "left-femur";
constexpr std::string_view kRightFemur = "right-femur";
constexpr int kMarrowHu = -60;
constexpr int kCartilageHu = 90;
constexpr int kLinerHu = -80;  // polyethylene
const Vector3d hip_mm(88.0, 0.0, 0.0);
const Vector3d trochanter_mm(142.0, 12.0, -18.0);
const Vector3d shaft_top_mm(136.0, 10.0, -42.0);
const Vector3d shaft_end_mm(121.0, 2.0, -190.0);

void add_soft_tissue(const Anatomy& anatomy, std::vector<Solid>& solids) {
  const auto add = [&](const Solid& solid) { solids.push_back(solid); };
  const Vector3d fat = anatomy.fat_mm() * Vector3d(1.0, 1.0, 0.0);
  add(elliptic_cylinder({0.0, 8.0, 90.0}, Vector3d(176.0, 112.0, 110.0) + fat, kFatHu));
  add(ellipsoid({0.0, 8.0, -15.0}, Vector3d(172.0, 112.0, 75.0) + fat, kFatHu));
  for (const double side : {-1.0, 1.0}) {
    add(ellipsoid({side * 92.0, 12.0, -40.0}, Vector3d(92.0, 106.0, 90.0) + fat, kFatHu));
    add(elliptic_cylinder(
        {side * 94.0, 4.0, -130.0}, Vector3d(88.0, 98.0, 100.0) + 0.7 * fat, kFatHu));
  }
  add(elliptic_cylinder({0.0, 4.0, 90.0}, {160.0, 88.0, 110.0}, kMuscleHu));
  add(ellipsoid({0.0, 4.0, -15.0}, {155.0, 86.0, 62.0}, kMuscleHu));
  for (const double side : {-1.0, 1.0}) {
    add(ellipsoid({side * 90.0, 60.0, -10.0}, {72.0, 46.0, 88.0}, kMuscleHu));  // gluteal muscles
    add(elliptic_cylinder({side * 98.0, 2.0, -130.0}, {70.0, 78.0, 120.0}, kMuscleHu));
  }
  // Fat and bowel within the pelvis.
  add(ellipsoid({0.0, -12.0, 60.0}, {82.0, 52.0, 92.0}, -70, 60));
  const auto organ = [&](int index, const Vector3d& center, const Vector3d& half_sizes) {
    return ellipsoid(center + anatomy.shift3("organ place", 5.0, index),
                     half_sizes * anatomy.factor("organ", 0.15, index),
                     0);
  };
  const auto add_organ = [&](Solid solid, int hu, int texture_hu) {
    solid.hu = hu;
    solid.texture_hu = texture_hu;
    solids.push_back(solid);
  };
  add_organ(organ(0, {0.0, -22.0, 2.0}, {38.0, 30.0, 30.0}), 8, 0);    // bladder
  add_organ(organ(1, {4.0, 46.0, 12.0}, {17.0, 18.0, 40.0}), 30, 30);  // rectum
  add_organ(organ(1, {5.0, 40.0, 22.0}, {9.0, 8.0, 16.0}), kGasHu, 0);
  add_organ(organ(2, {52.0, -32.0, 72.0}, {20.0, 20.0, 42.0}), 25, 40);  // sigmoid, left
  add_organ(organ(2, {54.0, -42.0, 84.0}, {11.0, 8.0, 22.0}), kGasHu, 0);
  add_organ(organ(2, {34.0, -46.0, 52.0}, {13.0, 7.0, 9.0}), kGasHu, 0);
  add_organ(organ(3, {-68.0, -30.0, 78.0}, {26.0, 24.0, 40.0}), 20, 70);  // caecum, right
  add_gas(anatomy, {{-75.0, -52.0, 40.0}, {75.0, -10.0, 140.0}}, solids);
}

/// Arthrosis of a hip. One side is often worse.
double hip_wear(const Anatomy& anatomy, double side) {
  return anatomy.arthrosis() * anatomy.between("hip wear", 0.2, 1.0, 0.0, side > 0.0 ? 1 : 0);
}

/// The wing: a plate between the line above the joint and the crest.
void add_ilium(const Anatomy& anatomy, double side, BonePainter& bone) {
  constexpr int kRibs = 30;
  std::array<Vector3d, 4> crest{Vector3d(124.0, -46.0, 76.0),
                                Vector3d(138.0, -6.0, 118.0),
                                Vector3d(108.0, 46.0, 122.0),
                                Vector3d(50.0, 80.0, 84.0)};
  const std::array<Vector3d, 4> root{Vector3d(100.0, -26.0, 26.0),
                                     Vector3d(94.0, -4.0, 30.0),
                                     Vector3d(78.0, 26.0, 32.0),
                                     Vector3d(54.0, 56.0, 30.0)};
  for (int i = 0; i < 4; ++i) crest[static_cast<std::size_t>(i)] += anatomy.shift3("crest", 4.0, i);
  const double thickness = anatomy.factor("ilium", 0.12);
  // Cubic Bezier curves through the first and last points.
  const auto curve = [](const std::array<Vector3d, 4>& p, double t) {
    const double u = 1.0 - t;
    return Vector3d(u * u * u * p[0] + 3.0 * u * u * t * p[1] + 3.0 * u * t * t * p[2] +
                    t * t * t * p[3]);
  };
  std::vector<Vector3d> rim;
  for (int i = 0; i <= kRibs; ++i) {
    const double t = static_cast<double>(i) / kRibs;
    const Vector3d low = mirrored(curve(root, t), side);
    rim.push_back(mirrored(curve(crest, t), side));
    bone.add_capsule(low, rim.back(), thickness * (4.0 + 2.0 * std::abs(2.0 * t - 1.0)));
  }
  bone.add_chain(rim, 7.5 * thickness);
  bone.add_capsule(mirrored({100.0, -26.0, 26.0}, side), mirrored({108.0, -38.0, 44.0}, side), 8.0);
  // The thick border of the pelvic inlet runs from the joint to the sacrum.
  bone.add_chain({mirrored({82.0, -18.0, 20.0}, side),
                  mirrored({72.0, 14.0, 34.0}, side),
                  mirrored({54.0, 46.0, 52.0}, side)},
                 10.0);
}

void add_pubis_and_ischium(const Anatomy& anatomy, double side, BonePainter& bone) {
  // The arch of the pubis is wider or narrower below.
  const double arch_mm = anatomy.shift("pubic arch", 3.0);
  const double stout = anatomy.factor("pubis", 0.08);
  const auto at = [&](double x, double y, double z) {
    return mirrored({x + (z < -40.0 ? arch_mm : 0.0), y, z}, side);
  };
  bone.add_chain({at(74.0, -18.0, 4.0), at(44.0, -42.0, 8.0), at(16.0, -50.0, -8.0)}, 8.5 * stout);
  bone.add_chain({at(13.0, -50.0, -10.0), at(13.0, -48.0, -36.0)}, 9.5 * stout);
  bone.add_chain({at(14.0, -46.0, -38.0), at(32.0, -22.0, -60.0), at(52.0, 10.0, -76.0)},
                 7.0 * stout);
  bone.add_chain({at(80.0, 16.0, -14.0), at(72.0, 28.0, -46.0), at(60.0, 24.0, -74.0)}, 14.0);
  bone.add(ellipsoid(at(58.0, 22.0, -74.0), {15.0, 17.0, 19.0}, kCorticalHu));
  bone.add_capsule(at(70.0, 34.0, -22.0), at(58.0, 48.0, -26.0), 5.0);  // ischial spine
}

std::string_view femur_of(double side) {
  return side > 0.0 ? kLeftFemur : kRightFemur;
}

/// The part of the femur that moves: head, neck and trochanters.
PhantomBone movable_femur(double side) {
  return {femur_of(side), target_box_at(mirrored({115.0, 5.0, -25.0}, side), 60.0)};
}

void add_femur(const Anatomy& anatomy, double side, BonePainter& bone) {
  const auto at = [&](const Vector3d& point) { return mirrored(point, side); };
  const double head = anatomy.factor("femoral head", 0.04) * (1.0 + 0.06 * hip_wear(anatomy, side));
  bone.add(ellipsoid(at(hip_mm), Vector3d::Constant(24.0 * head), kCorticalHu));
  const Vector3d neck(0.0, anatomy.shift("anteversion", 4.0), anatomy.shift("neck", 4.0));
  bone.add_capsule(at(hip_mm),
                   at(Vector3d(130.0, 8.0, -26.0) + neck),
                   16.0 * anatomy.factor("neck width", 0.05));
  bone.add(ellipsoid(at(trochanter_mm + neck),
                     anatomy.factor("trochanter", 0.06) * Vector3d(15.0, 20.0, 24.0),
                     kCorticalHu));
  bone.add(ellipsoid(at(Vector3d(118.0, 22.0, -62.0) + anatomy.shift3("lesser trochanter", 2.0)),
                     {10.0, 9.0, 13.0},
                     kCorticalHu));
  bone.add_capsule(at({134.0, 9.0, -30.0}), at({132.0, 8.0, -62.0}), 19.0);
  bone.add_capsule(at({132.0, 8.0, -62.0}), at({130.5, 7.0, -84.0}), 16.5);
}

/// The shaft: a thick cortex around fatty marrow.
void add_shaft(const Anatomy& anatomy, double side, std::vector<Solid>& solids) {
  const Vector3d top = mirrored(shaft_top_mm, side) - Vector3d(0.0, 0.0, 30.0);
  const Vector3d end = mirrored(shaft_end_mm, side);
  const double width = anatomy.factor("shaft", 0.06);
  solids.push_back(capsule_between(top, end, 14.5 * width, 1350));
  solids.push_back(capsule_between(top + Vector3d(0.0, 0.0, 14.0),
                                   end,
                                   7.5 * width * anatomy.factor("marrow", 0.12),
                                   kMarrowHu));
}

/// Beaks at the socket's rim and dense bone above the joint.
void add_hip_wear(const Anatomy& anatomy,
                  double side,
                  const Vector3d& opening,
                  std::vector<Solid>& solids) {
  constexpr int kBeaks = 11;
  constexpr double kRimMm = 29.0;
  const double wear = hip_wear(anatomy, side);
  if (wear < 0.15) return;
  const Vector3d hip = mirrored(hip_mm, side);
  const Vector3d across = opening.cross(Vector3d::UnitY()).normalized();
  const Vector3d up = across.cross(opening);
  const int key = side > 0.0 ? 100 : 0;
  BonePainter bone(solids, 1.2);
  for (int i = 0; i < kBeaks; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / kBeaks;
    const Vector3d rim =
        hip + 8.0 * opening + kRimMm * (std::cos(angle) * across + std::sin(angle) * up);
    const double length_mm = wear * anatomy.between("rim beak", 0.0, 9.0, 0.0, key + i);
    if (length_mm > 1.5)
      bone.add_capsule(
          rim, rim + length_mm * opening, anatomy.between("beak radius", 2.0, 3.6, 2.0, key + i));
  }
  constexpr int kSclerosisHu = 1150;
  solids.push_back(ellipsoid(hip + Vector3d(-side * 6.0, 0.0, 31.0),
                             Vector3d(15.0, 12.0, 2.0 + 4.0 * wear),
                             kSclerosisHu));
}

void add_hip(const Anatomy& anatomy, double side, std::vector<Solid>& solids) {
  {
    BonePainter bone(solids, 2.2 * anatomy.shell());
    add_ilium(anatomy, side, bone);
    add_pubis_and_ischium(anatomy, side, bone);
    bone.add(ellipsoid(mirrored({80.0, 2.0, 4.0}, side), {31.0, 33.0, 34.0}, kCorticalHu));
  }
  // The socket opens outwards, forwards and down.
  const Vector3d opening = mirrored(Vector3d(0.78, -0.26, -0.57).normalized(), side);
  solids.push_back(ellipsoid(mirrored(hip_mm, side), Vector3d::Constant(29.5), kCorticalHu));
  solids.push_back(capsule_between(
      mirrored(hip_mm, side), mirrored(hip_mm, side) + 22.0 * opening, 27.0, kCartilageHu));
  add_hip_wear(anatomy, side, opening, solids);
  const std::size_t femur = solids.size();
  add_shaft(anatomy, side, solids);
  {
    BonePainter bone(solids, 1.8 * anatomy.shell());
    add_femur(anatomy, side, bone);
  }
  give_to_bone(femur_of(side), solids, femur);
}

void add_sacrum(const Anatomy& anatomy, std::vector<Solid>& solids) {
  constexpr int kSegments = 5;
  const double curve = anatomy.factor("sacral curve", 0.25);
  const double width = anatomy.factor("sacrum", 0.05);
  const auto sacral_point = [&](double share) {
    return Vector3d(0.0, 40.0 + 62.0 * share - curve * 26.0 * share * share, 82.0 - 112.0 * share);
  };
  {
    BonePainter bone(solids, 1.6 * anatomy.shell());
    for (int i = 0; i < kSegments; ++i) {
      const double share = i / 5.0 + 0.04;
      bone.add(ellipsoid(sacral_point(share),
                         {28.0 - 17.0 * share, 17.0 - 9.0 * share, 14.5 - 3.0 * share},
                         kCorticalHu));
      for (const double side : {-1.0, 1.0})
        bone.add(ellipsoid(
            sacral_point(share) + Vector3d(side * width * (32.0 - 22.0 * share), 8.0, -3.0),
            {25.0 - 14.0 * share, 13.0 - 5.0 * share, 18.0 - 5.0 * share},
            kCorticalHu));
      bone.add(ellipsoid(sacral_point(share) + Vector3d(0.0, 24.0 - 8.0 * share, -6.0),
                         {4.0, 8.0, 11.0},
                         kCorticalHu));
    }
    bone.add_chain({sacral_point(0.98), Vector3d(0.0, 78.0, -44.0), Vector3d(0.0, 64.0, -62.0)},
                   5.5);
  }
  for (int i = 0; i + 1 < kSegments; ++i)
    for (const double side : {-1.0, 1.0}) {
      const double share = i / 5.0 + 0.14;
      const Vector3d hole =
          sacral_point(share) + Vector3d(side * width * (23.0 - 12.0 * share), 0.0, 0.0);
      solids.push_back(capsule_between(hole - Vector3d(0.0, 12.0, 2.0),
                                       hole + Vector3d(0.0, 20.0, -2.0),
                                       4.3 * anatomy.factor("foramina", 0.12, i),
                                       0));
    }
}

void add_lumbar_spine(const Anatomy& anatomy, std::vector<Solid>& solids) {
  const std::array<Vertebra, 3> vertebrae{Vertebra{-5, {0.0, 30.0, 112.0}, 26.0, 17.5, 13.5},
                                          Vertebra{-4, {1.0, 26.0, 148.0}, 25.0, 17.0, 13.8},
                                          Vertebra{-3, {2.0, 26.0, 184.0}, 24.0, 16.5, 13.8}};
  solids.push_back(elliptic_cylinder({0.0, 29.0, 130.0}, {25.0, 16.5, 44.0}, 90));
  for (const Vertebra& v : vertebrae) add_vertebra(varied(v, anatomy, v.level), solids);
}

/// A total hip prosthesis. The bodies are those of the left side. Neck, ball and stem belong to the
/// femur.
void add_prosthesis(double side, std::vector<Solid>& solids) {
  const std::string_view femur = femur_of(side);
  const auto add = [&](Solid solid, std::string_view bone = {}) {
    // The mirror image of a body of revolution is the body with a mirrored axis.
    const Vector3d axis = mirrored(solid.rotation.col(2), side);
    solid.center_mm = mirrored(solid.center_mm, side);
    if (side < 0.0) solid.rotation = rotation_between(Vector3d::UnitZ(), axis);
    solid.bone = bone;
    solids.push_back(solid);
  };
  const Vector3d opening = Vector3d(0.66, -0.26, -0.70).normalized();
  // The places of the socket's lining and of the resected head and neck heal with soft tissue.
  // Liner and metal cup face outwards. Wherever the femur is, its resected head is gone.
  const Solid healed = ellipsoid(hip_mm, Vector3d::Constant(29.0), kMuscleHu);
  add(healed);
  add(healed, femur);
  add(capsule_between(hip_mm, {112.0, 4.0, -12.0}, 17.0, kMuscleHu), femur);
  Solid cup = ellipsoid(hip_mm, Vector3d::Constant(27.0), kTitaniumHu);
  cup.shape = Solid::Shape::HalfEllipsoid;
  cup.rotation = rotation_between(Vector3d::UnitZ(), -opening);
  add(cup);
  Solid liner = cup;
  liner.half_sizes_mm = Vector3d::Constant(23.5);
  liner.hu = kLinerHu;
  add(liner);
  for (const Vector3d& direction : {Vector3d(-0.45, 0.35, 0.82), Vector3d(-0.2, 0.65, 0.73)})
    add(capsule_between(hip_mm + 26.0 * direction.normalized(),
                        hip_mm + 52.0 * direction.normalized(),
                        2.8,
                        kTitaniumHu));
  const Vector3d shoulder(128.0, 8.0, -28.0);
  add(capsule_between(hip_mm, shoulder, 6.5, kTitaniumHu), femur);
  add(ellipsoid(hip_mm, Vector3d::Constant(16.0), kTitaniumHu), femur);  // ball
  add(capsule_between(shoulder, {131.0, 8.0, -75.0}, 9.5, kTitaniumHu), femur);
  add(capsule_between({132.0, 8.0, -60.0}, {126.0, 5.0, -145.0}, 6.5, kTitaniumHu), femur);
}

/// Implants and calcifications that the typical adult lacks.
void add_drawn_implants(const Anatomy& anatomy, bool has_metal, Phantom& phantom) {
  std::vector<Solid>& solids = phantom.solids;
  if (has_metal || anatomy.has("left hip prosthesis", 0.12)) {
    add_prosthesis(1.0, solids);
    phantom.findings.emplace_back("a hip prosthesis on the left");
  }
  if (anatomy.has("right hip prosthesis", 0.15)) {
    add_prosthesis(-1.0, solids);
    phantom.findings.emplace_back("a hip prosthesis on the right");
  } else if (anatomy.has("neck screws", 0.1)) {
    const std::size_t screws = solids.size();
    for (int i = 0; i < 3; ++i) {
      const Vector3d offset(0.0, i == 0 ? -7.0 : 7.0, i == 2 ? 7.0 : -6.0);
      const Vector3d head = mirrored(Vector3d(148.0, 10.0, -36.0) + offset, -1.0);
      const Vector3d tip = mirrored(hip_mm + 0.8 * offset, -1.0);
      solids.push_back(capsule_between(head, tip, 3.2, kTitaniumHu));
    }
    give_to_bone(kRightFemur, solids, screws);
    phantom.findings.emplace_back("screws in the right femoral neck");
  }
  constexpr int kStoneHu = 700;
  const int stones = static_cast<int>(anatomy.between("phleboliths", -4.0, 9.0, 0.0));
  for (int i = 0; i < stones; ++i)
    solids.push_back(ellipsoid(
        Vector3d(i % 2 == 0 ? 50.0 : -50.0, 20.0, -25.0) + anatomy.shift3("phlebolith", 9.0, i),
        Vector3d::Constant(anatomy.between("stone", 1.2, 2.6, 2.0, i)),
        kStoneHu));
}

}  // namespace

Phantom pelvis_phantom(bool has_metal, const Anatomy& anatomy) {
  constexpr double kBoxHalfMm = 30.0;
  constexpr double kWaveMm = 3.0;
  Phantom phantom{{},
                  {190.0, 130.0, 150.0},
                  target_box_at({76.0, 0.0, 6.0}, 2.0 * kBoxHalfMm),
                  {},
                  {movable_femur(1.0), movable_femur(-1.0)}};
  std::vector<Solid>& solids = phantom.solids;
  add_soft_tissue(anatomy, solids);
  add_sacrum(anatomy, solids);
  add_lumbar_spine(anatomy, solids);
  for (const double side : {-1.0, 1.0}) add_hip(anatomy, side, solids);
  solids.push_back(ellipsoid({0.0, -49.0, -22.0}, {3.5, 10.0, 20.0}, kCartilageHu));  // symphysis
  if (anatomy.is_typical()) {
    if (has_metal) add_prosthesis(1.0, solids);
    return phantom;
  }
  add_drawn_implants(anatomy, has_metal, phantom);
  return shaped(std::move(phantom), anatomy, Habitus(anatomy, kWaveMm, false));
}

}  // namespace af
