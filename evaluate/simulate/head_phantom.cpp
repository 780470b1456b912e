// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/head_phantom.h"

#include <array>
#include <cmath>
#include <numbers>
#include <utility>

namespace af {

namespace {

using Eigen::Vector3d;

constexpr std::string_view kJaw = "jaw";
constexpr int kBrainHu = 35;
constexpr int kWaterHu = 5;
constexpr int kToothHu = 1800;
constexpr int kDenseBoneHu = 1500;
constexpr int kAmalgamHu = 15000;
const Vector3d vault_mm(0.0, 8.0, 34.0);
const Vector3d vault_half_mm(73.0, 91.0, 74.0);

void add_soft_tissue(const Anatomy& anatomy, std::vector<Solid>& solids) {
  const auto add = [&](const Solid& solid) { solids.push_back(solid); };
  const Vector3d fat = 0.4 * anatomy.fat_mm() * Vector3d(1.0, 1.0, 0.0);
  add(elliptic_cylinder({0.0, 18.0, -125.0}, Vector3d(57.0, 58.0, 60.0) + fat, kMuscleHu));  // neck
  add(ellipsoid({0.0, 40.0, -62.0}, {56.0, 44.0, 48.0}, kMuscleHu));                         // nape
  add(ellipsoid({0.0, -34.0, -46.0}, {66.0, 62.0, 70.0}, 30, 15));                           // face
  add(ellipsoid({0.0, -70.0, -92.0}, {30.0, 32.0, 24.0}, 20, 15));                           // chin
  add(ellipsoid({0.0, -98.0, -34.0}, {12.0, 16.0, 17.0}, 20));                               // nose
  add(ellipsoid({0.0, -88.0, -10.0}, {9.0, 17.0, 24.0}, 20));                 // its bridge
  add(ellipsoid({0.0, -60.0, -6.0}, {66.0, 43.0, 30.0}, 20, 15));             // brow and eyelids
  add(ellipsoid(vault_mm, vault_half_mm + Vector3d::Constant(6.0), 20, 30));  // scalp
  for (const double side : {-1.0, 1.0})
    add(ellipsoid({side * 56.0, -22.0, -42.0}, {11.0, 22.0, 30.0}, 60));  // masticatory muscles
}

/// Outer table, diploe, inner table, brain.
void add_vault(const Anatomy& anatomy, std::vector<Solid>& solids) {
  const double thickness = anatomy.factor("vault thickness", 0.16);
  const auto add = [&](double inwards_mm, int hu, int texture_hu) {
    solids.push_back(ellipsoid(
        vault_mm, vault_half_mm - Vector3d::Constant(thickness * inwards_mm), hu, texture_hu));
  };
  add(0.0, 1150, 0);
  add(1.8, 450, 160);
  add(4.8, 1150, 0);
  add(6.4, kBrainHu, 6);
  for (const double side : {-1.0, 1.0}) {
    solids.push_back(ellipsoid({side * 12.0, 4.0, 42.0},
                               anatomy.factor("ventricles", 0.25) * Vector3d(6.0, 30.0, 9.0),
                               kWaterHu));                                          // ventricles
    solids.push_back(ellipsoid({side * 2.5, -80.0, 18.0}, {3.0, 5.0, 14.0}, 900));  // frontal crest
    if (anatomy.has("calcified choroid plexus", 0.5))
      solids.push_back(ellipsoid(Vector3d(side * 20.0, 34.0, 30.0) + anatomy.shift3("plexus", 3.0),
                                 {2.0, 3.5, 3.0},
                                 450,
                                 200));
  }
  if (anatomy.has("calcified pineal gland", 0.6))
    solids.push_back(ellipsoid(
        Vector3d(0.0, 20.0, 12.0) + anatomy.shift3("pineal gland", 1.5), {2.5, 3.0, 2.5}, 500));
  const int plates = static_cast<int>(anatomy.between("calcified falx", -4.0, 3.0, 0.0));
  for (int i = 0; i < plates; ++i)
    solids.push_back(
        ellipsoid(Vector3d(0.0, -40.0 + 25.0 * i, 86.0) + anatomy.shift3("falx", 5.0, i),
                  {1.2, 9.0, 4.0},
                  700));
}

void add_skull_base(const Anatomy& anatomy, std::vector<Solid>& solids) {
  {
    BonePainter bone(solids, 2.0 * anatomy.shell());
    for (const double side : {-1.0, 1.0}) {
      const auto at = [&](double x, double y, double z) { return mirrored({x, y, z}, side); };
      bone.add_chain({at(8.0, -58.0, 6.0), at(34.0, -60.0, 10.0), at(58.0, -46.0, 8.0)}, 4.0);
      bone.add_chain({at(10.0, -24.0, -2.0), at(34.0, -36.0, 4.0), at(58.0, -38.0, 12.0)}, 4.5);
      bone.add(ellipsoid(at(30.0, -12.0, -27.0), {26.0, 26.0, 5.0}, kCorticalHu));
      const double mastoid = anatomy.factor("mastoid", 0.08, side > 0.0 ? 1 : 0);
      bone.add(ellipsoid(
          at(58.0, 24.0, -34.0), mastoid * Vector3d(12.0, 15.0, 23.0), kCorticalHu));  // mastoid
      bone.add_capsule(at(12.0, 4.0, -34.0), at(14.0, 40.0, -40.0), 5.0);  // foramen magnum's rim
      bone.add_capsule(at(16.0, -32.0, -24.0), at(18.0, -34.0, -50.0), 3.5);  // pterygoid plate
    }
    bone.add_capsule({0.0, -12.0, -8.0}, {0.0, 6.0, -34.0}, 9.0);  // clivus
    bone.add(ellipsoid({0.0, -32.0, -10.0}, {19.0, 20.0, 15.0}, kCorticalHu));
  }
  for (const double side : {-1.0, 1.0}) {
    const auto at = [&](double x, double y, double z) { return mirrored({x, y, z}, side); };
    const int index = side > 0.0 ? 1 : 0;
    const Vector3d apex = anatomy.shift3("petrous apex", 2.0, index);
    Solid petrous = capsule_between(at(56.0, 16.0, -16.0),
                                    at(14.0 + apex.x(), -8.0 + apex.y(), -18.0 + apex.z()),
                                    9.0 * anatomy.factor("petrous bone", 0.08, index),
                                    kDenseBoneHu);
    petrous.texture_hu = 250;
    solids.push_back(petrous);
    solids.push_back(capsule_between(at(66.0, 10.0, -18.0), at(40.0, 8.0, -18.0), 3.0, kGasHu));
    const double cells = anatomy.between("air cells", 0.3, 1.1, 1.0, index);
    solids.push_back(ellipsoid(
        at(59.0, 25.0, -32.0), cells * Vector3d(8.0, 10.0, 17.0), -150, 800));  // air cells
    solids.push_back(ellipsoid(at(28.0, 6.0, -16.0), {3.0, 3.0, 3.0}, 0));      // cochlea
    solids.push_back(capsule_between(at(7.0, -22.0, 1.0), at(6.0, -18.0, 5.0), 2.2, kCorticalHu));
  }
  solids.push_back(capsule_between({-7.0, -10.0, 2.0}, {7.0, -10.0, 2.0}, 2.5, kCorticalHu));
  solids.push_back(ellipsoid({0.0, -17.0, 0.0}, {7.0, 5.5, 5.0}, kBrainHu));  // sella
  const auto sinus = [&](int index) { return anatomy.between("sinus", 0.4, 1.2, 1.0, index); };
  solids.push_back(
      ellipsoid({6.0, -34.0, -11.0}, sinus(0) * Vector3d(8.0, 14.0, 9.0), kGasHu));  // sphenoid
  solids.push_back(ellipsoid({-8.0, -33.0, -12.0}, sinus(1) * Vector3d(6.0, 11.0, 8.0), kGasHu));
}

void add_orbits(const Anatomy& anatomy, std::vector<Solid>& solids) {
  const double orbit = anatomy.factor("orbits", 0.05);
  {
    BonePainter bone(solids, 1.6 * anatomy.shell());
    for (const double side : {-1.0, 1.0}) {
      bone.add(ellipsoid(
          mirrored({33.0, -62.0, -8.0}, side), orbit * Vector3d(25.0, 27.0, 23.0), kCorticalHu));
      bone.add_chain({mirrored({12.0, -84.0, 12.0}, side),
                      mirrored({34.0, -83.0, 14.0}, side),
                      mirrored({54.0, -70.0, 4.0}, side),
                      mirrored({56.0, -66.0, -12.0}, side)},
                     4.5);
    }
    bone.add_chain({Vector3d(0.0, -86.0, 6.0), Vector3d(0.0, -94.0, -12.0)}, 5.0);  // nasal bones
  }
  for (const double side : {-1.0, 1.0}) {
    solids.push_back(
        ellipsoid(mirrored({34.0, -68.0, -8.0}, side), orbit * Vector3d(20.5, 27.0, 18.5), -70));
    solids.push_back(ellipsoid(mirrored({34.0, -76.0, -8.0}, side), Vector3d::Constant(12.0), 15));
  }
  solids.push_back(ellipsoid({0.0, -76.0, 15.0}, {30.0, 9.0, 16.0}, kCorticalHu));
  if (anatomy.has("no frontal sinuses", 0.08)) return;
  const auto sinus = [&](int index) { return anatomy.between("sinus", 0.35, 1.25, 1.0, index); };
  solids.push_back(
      ellipsoid({13.0, -77.0, 18.0}, sinus(2) * Vector3d(13.0, 5.0, 11.0), kGasHu));  // frontal
  solids.push_back(ellipsoid({-9.0, -77.0, 16.0}, sinus(3) * Vector3d(9.0, 4.5, 9.0), kGasHu));
}

void add_nose_and_cheeks(const Anatomy& anatomy, std::vector<Solid>& solids) {
  const auto antrum = [&](double side) {
    return anatomy.factor("maxillary sinus", 0.09, side > 0.0 ? 1 : 0);
  };
  {
    BonePainter bone(solids, 1.4 * anatomy.shell());
    for (const double side : {-1.0, 1.0}) {
      const auto at = [&](double x, double y, double z) { return mirrored({x, y, z}, side); };
      bone.add(ellipsoid(
          at(30.0, -62.0, -40.0), antrum(side) * Vector3d(18.0, 20.0, 19.0), kCorticalHu));
      const double arch_mm = anatomy.shift("zygomatic arch", 2.0);
      bone.add_chain({at(46.0, -72.0, -28.0),
                      at(60.0 + arch_mm, -52.0, -26.0),
                      at(67.0 + arch_mm, -28.0, -22.0),
                      at(65.0, -4.0, -20.0)},
                     4.0 * anatomy.factor("zygomatic bone", 0.12));
      bone.add(ellipsoid(at(46.0, -68.0, -28.0), {11.0, 10.0, 11.0}, kCorticalHu));
    }
    bone.add(ellipsoid({0.0, -66.0, -58.0}, {27.0, 25.0, 8.0}, kCorticalHu));  // palate
  }
  for (const double side : {-1.0, 1.0})
    solids.push_back(ellipsoid(
        mirrored({30.0, -62.0, -40.0}, side), antrum(side) * Vector3d(16.3, 18.3, 17.3), kGasHu));
  solids.push_back(ellipsoid({0.0, -66.0, -34.0}, {14.0, 32.0, 24.0}, kGasHu));
  for (const double side : {-1.0, 1.0}) {
    solids.push_back(ellipsoid(mirrored({9.0, -64.0, -42.0}, side), {3.5, 22.0, 6.0}, 40));
    solids.push_back(ellipsoid(mirrored({9.0, -62.0, -28.0}, side), {3.0, 18.0, 5.0}, 40));
    solids.push_back(ellipsoid(mirrored({9.0, -62.0, -14.0}, side), {5.0, 20.0, 8.0}, -500, 700));
  }
  solids.push_back(ellipsoid(
      {0.8 + anatomy.shift("septum", 1.5), -68.0, -32.0}, {1.2, 30.0, 26.0}, 500));  // septum
}

/// Places along a dental arch, from the right last molar to the left one.
Vector3d arch_point(double angle_deg, double half_width_mm, double length_mm, double z_mm) {
  const double angle = angle_deg * std::numbers::pi / 180.0;
  return {half_width_mm * std::sin(angle), -46.0 - length_mm * std::cos(angle), z_mm};
}

/// Share of the teeth that are lost: none in half of the patients, all in one of ten.
double tooth_loss(const Anatomy& anatomy) {
  const double draw = anatomy.between("tooth loss", 0.0, 1.0, 0.0);
  return draw < 0.5 ? 0.0 : (draw < 0.9 ? draw - 0.5 : 1.0);
}

void add_mandible(const Anatomy& anatomy, std::vector<Solid>& solids) {
  BonePainter bone(solids, 2.4 * anatomy.shell());
  // A jaw without teeth shrinks.
  const double height = anatomy.factor("jaw", 0.08) * (1.0 - 0.25 * tooth_loss(anatomy));
  std::vector<Vector3d> body;
  for (int i = -8; i <= 8; ++i)
    body.push_back(arch_point(11.0 * i, 40.0, 42.0, -96.0 + 0.35 * std::abs(i)));
  bone.add_chain(body, 8.0 * height);
  bone.add(ellipsoid(Vector3d(0.0, -88.0, -99.0) + anatomy.shift3("chin", 2.5),
                     height * Vector3d(15.0, 8.0, 9.0),
                     kCorticalHu));  // chin
  for (const double side : {-1.0, 1.0}) {
    const auto at = [&](double x, double y, double z) { return mirrored({x, y, z}, side); };
    bone.add_chain({at(40.0, -46.0, -92.0), at(46.0, -18.0, -80.0)}, 8.0);
    bone.add_chain({at(46.0, -18.0, -80.0), at(50.0, -10.0, -50.0), at(52.0, -2.0, -26.0)}, 6.0);
    bone.add_chain({at(44.0, -34.0, -80.0), at(50.0, -24.0, -50.0), at(51.0, -30.0, -36.0)}, 4.5);
    bone.add(ellipsoid(at(52.0, -2.0, -25.0), {9.0, 5.0, 5.0}, kCorticalHu));  // condyle
  }
}

/// A screw in the jaw with a crown on it.
void add_dental_implant(const Vector3d& crown, const Vector3d& root, std::vector<Solid>& solids) {
  solids.push_back(capsule_between(crown, root, 2.0, kTitaniumHu));
  solids.push_back(ellipsoid(crown, {3.8, 3.6, 4.0}, 3000));
}

void add_teeth(const Anatomy& anatomy, std::vector<Solid>& solids, bool has_fillings) {
  const double filled = anatomy.between("filled", 0.0, 0.35, 0.0);
  for (const bool is_upper : {true, false}) {
    const std::size_t first = solids.size();
    for (int i = 0; i < 16; ++i) {
      const int tooth = (is_upper ? 100 : 200) + i;
      const double angle_deg = 10.8 * (i - 7.5);
      const bool is_molar = std::abs(i - 7.5) > 3.0;
      const double width_mm = is_upper ? 31.0 : 29.0;
      const Vector3d crown = arch_point(angle_deg, width_mm, 38.0, is_upper ? -67.0 : -78.0) +
                             anatomy.shift3("tooth", 0.6, tooth);
      const Vector3d root = crown + Vector3d(0.0, 4.0, is_upper ? 13.0 : -13.0) +
                            anatomy.shift3("tooth root", 1.0, tooth);
      if (anatomy.has("lost tooth", tooth_loss(anatomy), tooth)) {
        if (anatomy.has("dental implant", 0.15, tooth)) add_dental_implant(crown, root, solids);
        continue;
      }
      solids.push_back(capsule_between(crown, root, is_molar ? 3.4 : 2.3, 1200));
      solids.push_back(
          ellipsoid(crown, is_molar ? Vector3d(4.6, 4.6, 4.4) : Vector3d(3.2, 2.6, 5.0), kToothHu));
      const bool is_filled = (has_fillings && (i == 1 || i == 2 || i == 13)) ||
                             (is_molar && anatomy.has("filling", filled, tooth));
      if (is_filled)
        solids.push_back(ellipsoid(
            crown + Vector3d(0.0, 0.0, is_upper ? -2.2 : 2.2), {2.8, 2.6, 1.8}, kAmalgamHu));
    }
    if (!is_upper) give_to_bone(kJaw, solids, first);
  }
}

/// Beaks at the front of a cervical body.
void add_cervical_wear(const Anatomy& anatomy,
                       int level,
                       const Vector3d& center,
                       BonePainter& bone) {
  for (int i = 0; i < 6; ++i) {
    const double length_mm =
        anatomy.arthrosis() * anatomy.between("neck beak", 0.0, 7.0, 0.0, 10 * level + i);
    if (length_mm < 1.5) continue;
    const double end = i < 3 ? 1.0 : -1.0;
    const Vector3d rim = center + Vector3d(5.0 * (i % 3 - 1), -6.5, end * 6.0);
    bone.add_capsule(rim, rim + Vector3d(0.0, -length_mm, end * 0.5 * length_mm), 1.7);
  }
}

void add_neck(const Anatomy& anatomy, std::vector<Solid>& solids) {
  const double size = anatomy.factor("vertebrae", 0.05);
  {
    BonePainter bone(solids, 1.6 * anatomy.shell());
    std::vector<Vector3d> atlas;  // C1 is a ring
    for (int i = 0; i <= 12; ++i) {
      const double angle = i * std::numbers::pi / 6.0;
      atlas.emplace_back(22.0 * std::sin(angle), 18.0 - 20.0 * std::cos(angle), -56.0);
    }
    bone.add_chain(atlas, 5.0);
    for (const double side : {-1.0, 1.0})
      bone.add(ellipsoid({side * 22.0, 12.0, -54.0}, {10.0, 10.0, 9.0}, kCorticalHu));
    bone.add_capsule({0.0, 6.0, -52.0}, {0.0, 8.0, -76.0}, 5.5);  // the dens of C2
  }
  for (int level = 0; level < 3; ++level) {
    const Vector3d center = Vector3d(0.0, 10.0 + 1.5 * level, -80.0 - 19.0 * level) +
                            anatomy.shift3("vertebra place", 0.7, level);
    BonePainter bone(solids, 1.6 * anatomy.shell());
    Solid body = elliptic_cylinder(
        center,
        Vector3d(10.5 * size, 8.5 * size, 7.5 * anatomy.factor("vertebra height", 0.07, level)),
        kCorticalHu);
    body.waist = 0.1;
    bone.add(body);
    add_cervical_wear(anatomy, level, center, bone);
    for (const double side : {-1.0, 1.0}) {
      const auto at = [&](double x, double y, double z) {
        return Vector3d(center + mirrored({x, y, z}, side));
      };
      bone.add_capsule(at(18.0, 10.0, 8.0), at(18.0, 13.0, -8.0), 5.0);  // articular pillar
      bone.add_chain({at(9.0, 4.0, 0.0), at(17.0, 10.0, 0.0), at(3.0, 28.0, -3.0)}, 3.4);
    }
    const double process = anatomy.factor("process", 0.1, level);
    bone.add_capsule(center + Vector3d(0.0, 28.0, -3.0),
                     center + Vector3d(0.0, 28.0 + 16.0 * process, -9.0),
                     3.6);
  }
  const std::array<Vector3d, 3> airway{
      Vector3d(0.0, -34.0, -44.0), Vector3d(0.0, -14.0, -72.0), Vector3d(0.0, -14.0, -150.0)};
  for (std::size_t i = 1; i < airway.size(); ++i)
    solids.push_back(capsule_between(airway[i - 1], airway[i], 7.5, kGasHu));
  solids.push_back(ellipsoid({0.0, -56.0, -76.0}, {22.0, 26.0, 15.0}, 55));
  solids.back().bone = kJaw;  // the tongue lies in its arch
}

/// A plate over a craniotomy.
void add_plate(std::vector<Solid>& solids) {
  std::vector<Vector3d> holes;
  for (int i = 0; i < 4; ++i) {
    const double angle = (18.0 + 7.0 * i) * std::numbers::pi / 180.0;
    const Vector3d direction(std::cos(angle), -0.35, std::sin(angle));
    const double reach = 1.0 / direction.cwiseQuotient(vault_half_mm).norm();
    holes.emplace_back(vault_mm + (reach + 0.006 * reach) * direction);
    solids.push_back(capsule_between(
        holes.back(), vault_mm + 0.94 * (holes.back() - vault_mm), 1.0, kTitaniumHu));
    solids.push_back(ellipsoid(holes.back(), Vector3d::Constant(2.0), kTitaniumHu));
    if (i > 0)
      solids.push_back(capsule_between(holes[holes.size() - 2], holes.back(), 0.9, kTitaniumHu));
  }
}

/// Adds implants such as an aneurysm's coil or a clip, which the typical adult lacks.
void add_drawn_implants(const Anatomy& anatomy, bool has_metal, Phantom& phantom) {
  if (has_metal || anatomy.has("plate", 0.12)) {
    add_plate(phantom.solids);
    phantom.findings.emplace_back("a plate on the left of the vault");
  }
  if (anatomy.has("coil", 0.07)) {
    const Vector3d place = Vector3d(12.0, -20.0, 8.0) + anatomy.shift3("coil", 3.0);
    phantom.solids.push_back(ellipsoid(
        place, Vector3d::Constant(anatomy.between("coil size", 2.0, 4.5, 3.0)), kAmalgamHu));
    phantom.findings.emplace_back("a coil in an aneurysm");
  }
  if (tooth_loss(anatomy) == 1.0)
    phantom.findings.emplace_back("no teeth");
  else if (tooth_loss(anatomy) > 0.0)
    phantom.findings.emplace_back("some teeth lost");
}

}  // namespace

Phantom head_phantom(bool has_metal, const Anatomy& anatomy) {
  constexpr double kBoxHalfMm = 30.0;
  constexpr double kWaveMm = 1.8;
  Phantom phantom{{},
                  {96.0, 122.0, 130.0},
                  target_box_at({0.0, -14.0, -14.0}, 2.0 * kBoxHalfMm),
                  {},
                  {{kJaw, target_box_at({0.0, -66.0, -92.0}, 2.0 * kBoxHalfMm)}}};
  std::vector<Solid>& solids = phantom.solids;
  add_soft_tissue(anatomy, solids);
  add_vault(anatomy, solids);
  add_skull_base(anatomy, solids);
  add_orbits(anatomy, solids);
  add_nose_and_cheeks(anatomy, solids);
  const std::size_t mandible = solids.size();
  add_mandible(anatomy, solids);
  give_to_bone(kJaw, solids, mandible);
  add_neck(anatomy, solids);
  add_teeth(anatomy, solids, has_metal);
  if (anatomy.is_typical()) {
    if (has_metal) add_plate(solids);
    return phantom;
  }
  add_drawn_implants(anatomy, has_metal, phantom);
  return shaped(std::move(phantom), anatomy, Habitus(anatomy, kWaveMm, false));
}

}  // namespace af
