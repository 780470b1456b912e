// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/spine_phantom.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

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
constexpr int kPlaqueHu = 1180;
/// Vertebrae that the volume holds whole.
constexpr std::array<std::string_view, 7> kWholeVertebrae{
    "L3", "L2", "L1", "T12", "T11", "T10", "T9"};
constexpr int kLowestWhole = -3;

/// The curve of the spine: kyphosis above, lordosis below, a slight bend to the left.
Vector3d spine_point(double z_mm) {
  return {3.5 * std::sin(z_mm / 70.0), 6.0 * std::sin(z_mm / 95.0), z_mm};
}

/// The vertebra that an old fracture has flattened, never the target. Without one, a number far
/// from all levels.
int fractured_level(const Anatomy& anatomy) {
  constexpr int kNone = 1000;
  if (!anatomy.has("old fracture", 0.12)) return kNone;
  return anatomy.has("fracture above", 0.5) ? 1 + static_cast<int>(anatomy.between("of", 0, 3, 0))
                                            : -1 - static_cast<int>(anatomy.between("of", 0, 3, 0));
}

Vertebra vertebra_at(int level, const Anatomy& anatomy = {}) {
  Vertebra v = varied({level,
                       spine_point(level * kPitchMm),
                       20.0 - 1.1 * level,
                       15.0 - 0.5 * level,
                       0.5 * (25.5 - 0.7 * level)},
                      anatomy,
                      level);
  if (level == fractured_level(anatomy)) v.half_height_mm *= 0.72;
  return v;
}

/// The name of a vertebra, empty when the volume cuts it.
std::string_view vertebra_name(int level) {
  const auto index = static_cast<std::size_t>(level - kLowestWhole);
  return index < kWholeVertebrae.size() ? kWholeVertebrae[index] : std::string_view();
}

/// The body of a vertebra with its pedicles.
RegistrationTarget vertebra_target(int level) {
  const Vertebra v = vertebra_at(level);
  const Vector3d half(v.half_width_mm + 4.0, v.half_depth_mm + 8.0, 18.0);
  const Vector3d center = v.center + Vector3d(0.0, 6.0, 0.0);
  return {center, {center - half, center + half}};
}

/// All whole vertebrae, from the head down.
std::vector<PhantomBone> whole_vertebrae() {
  std::vector<PhantomBone> bones;
  for (std::size_t i = kWholeVertebrae.size(); i-- > 0;)
    bones.push_back({kWholeVertebrae[i], vertebra_target(kLowestWhole + static_cast<int>(i))});
  return bones;
}

void add_disc(int level_below, const Anatomy& anatomy, std::vector<Solid>& solids) {
  const Vertebra below = vertebra_at(level_below, anatomy);
  const Vertebra above = vertebra_at(level_below + 1, anatomy);
  solids.push_back(
      elliptic_cylinder(0.5 * (below.center + above.center),
                        {below.half_width_mm - 0.5, below.half_depth_mm - 0.5, 0.5 * kPitchMm},
                        kDiscHu));
}

/// Adds each vertebra's part of the canal.
void add_canal(const Anatomy& anatomy, std::vector<Solid>& solids) {
  for (int level = -kVertebraeEachSide - 1; level <= kVertebraeEachSide + 1; ++level) {
    const Vertebra v = vertebra_at(level, anatomy);
    solids.push_back(elliptic_cylinder(v.center + Vector3d(0.0, v.half_depth_mm + 8.0, 0.0),
                                       {9.0, 7.5, 0.5 * kPitchMm},
                                       kCanalHu));
    solids.back().bone = vertebra_name(level);
  }
}

/// Points along a rib: head at the body, tubercle at the transverse process, then around the chest
/// wall and down.
std::vector<Vector3d> rib_points(const Vertebra& v, const Anatomy& anatomy, double side) {
  constexpr double kDegree = std::numbers::pi / 180.0;
  constexpr int kArcPoints = 24;
  const bool is_floating = v.level == 0;
  const int index = 2 * v.level + (side > 0.0 ? 1 : 0);
  const double end_deg = (is_floating ? 85.0 : std::min(150.0, 110.0 + 12.0 * v.level)) *
                         anatomy.factor("rib length", 0.06, index);
  const double total_drop_mm = (is_floating ? 45.0 : 75.0) * anatomy.factor("rib slope", 0.15) *
                               anatomy.factor("rib's slope", 0.05, index);
  // The spine sits deeper than the chest wall's back, so the ribs first run backwards, then around.
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

void add_ribs(const Anatomy& anatomy, std::vector<Solid>& solids) {
  const bool lacks_last = anatomy.has("no twelfth ribs", 0.08);
  for (int level = lacks_last ? 1 : 0; level <= kVertebraeEachSide + 2; ++level)
    for (const double side : {-1.0, 1.0}) {
      BonePainter bone(solids, 1.6 * anatomy.shell());
      const std::vector<Vector3d> points = rib_points(vertebra_at(level, anatomy), anatomy, side);
      const double radius = anatomy.factor("ribs", 0.12) * anatomy.factor("rib", 0.06, level);
      for (std::size_t i = 1; i < points.size(); ++i)
        bone.add_capsule(points[i - 1], points[i], (i < 2 ? 4.0 : 5.0) * radius);
    }
}

/// An organ in the patient's own place and size.
Solid organ(const Anatomy& anatomy,
            int index,
            const Vector3d& center,
            const Vector3d& half_sizes,
            int hu,
            int texture_hu = 0) {
  return ellipsoid(center + anatomy.shift3("organ place", 5.0, index),
                   half_sizes * anatomy.factor("organ", 0.1, index),
                   hu,
                   texture_hu);
}

void add_soft_tissue(const Anatomy& anatomy, std::vector<Solid>& solids) {
  const Vector3d middle(0.0, kTorsoMiddleMm, 0.0);
  const double fat_mm = anatomy.fat_mm();
  const auto add = [&](const Solid& solid) { solids.push_back(solid); };
  add(elliptic_cylinder(
      middle, {kTorsoHalfWidthMm + fat_mm, kTorsoHalfDepthMm + fat_mm, kHeightMm}, kFatHu));
  add(elliptic_cylinder(
      middle, {kTorsoHalfWidthMm - 12.0, kTorsoHalfDepthMm - 9.0, kHeightMm}, kMuscleHu));
  // Fat between the organs, in front of the spine.
  add(ellipsoid({0.0, -58.0, -70.0}, {106.0, 44.0, 140.0}, -60, 40));
  // Lung bases reach down beside T11; the left one is narrower for the heart.
  const Vector3d breath(0.0, 0.0, anatomy.shift("breath", 14.0));
  const Vector3d right_lung(-63.0, -14.0, 150.0);
  const Vector3d left_lung(65.0, -12.0, 150.0);
  add(ellipsoid(right_lung + breath, {49.0, 60.0, 120.0}, kLungHu, 60));
  add(ellipsoid(left_lung + breath, {46.0, 58.0, 128.0}, kLungHu, 60));
  add(organ(anatomy, 0, {22.0, -52.0, 120.0}, {48.0, 38.0, 62.0}, kMuscleHu));   // heart
  add(organ(anatomy, 1, {-56.0, -38.0, 8.0}, {66.0, 58.0, 52.0}, kOrganHu, 8));  // liver
  add(organ(anatomy, 2, {84.0, 6.0, 22.0}, {27.0, 34.0, 34.0}, kOrganHu, 8));    // spleen
  add(organ(anatomy, 3, {52.0, -58.0, 2.0}, {42.0, 34.0, 36.0}, 35));            // stomach
  const double gas = anatomy.between("stomach gas", 0.4, 1.25, 1.0);
  add(organ(anatomy, 3, {58.0, -72.0, 10.0}, gas * Vector3d(26.0, 15.0, 20.0), kGasHu));
  add(organ(anatomy, 4, {76.0, -50.0, -78.0}, {16.0, 18.0, 34.0}, 30));  // colon
  add(organ(anatomy, 4, {78.0, -56.0, -70.0}, {10.0, 9.0, 19.0}, kGasHu));
  add(organ(anatomy, 5, {-58.0, 18.0, -52.0}, {26.0, 22.0, 50.0}, 35));  // kidneys
  add(organ(anatomy, 6, {60.0, 18.0, -38.0}, {26.0, 22.0, 50.0}, 35));
  add(elliptic_cylinder({13.0, -27.0, 0.0}, {11.0, 11.0, kHeightMm}, 45));  // aorta
  add_gas(anatomy, {{-95.0, -88.0, -140.0}, {95.0, -35.0, -40.0}}, solids);
}

/// Plaques of the aorta's wall.
void add_calcifications(const Anatomy& anatomy, std::vector<Solid>& solids) {
  const int plaques = static_cast<int>(anatomy.between("plaques", -20.0, 28.0, 0.0));
  for (int i = 0; i < plaques; ++i) {
    const double angle = anatomy.between("plaque angle", 0.0, 6.283, 0.0, i);
    const Vector3d place(13.0 + 10.5 * std::cos(angle),
                         -27.0 + 10.5 * std::sin(angle),
                         anatomy.between("plaque height", -130.0, 130.0, 0.0, i));
    solids.push_back(ellipsoid(
        place, {1.6, 1.6, anatomy.between("plaque length", 1.5, 6.0, 1.5, i)}, kPlaqueHu));
  }
}

/// Pedicle screws from vertebra to vertebra and a rod on each side.
void add_screws_and_rods(const Anatomy& anatomy,
                         int lowest,
                         int highest,
                         std::vector<Solid>& solids) {
  constexpr double kScrewRadiusMm = 2.8;
  constexpr double kHeadRadiusMm = 5.0;
  for (const double side : {-1.0, 1.0}) {
    std::vector<Vector3d> heads;
    for (int level = lowest; level <= highest; ++level) {
      const Vertebra v = vertebra_at(level, anatomy);
      const Vector3d tip = v.center + Vector3d(side * 8.0, -0.4 * v.half_depth_mm, 3.0);
      const Vector3d head = v.center + Vector3d(side * 17.0, v.half_depth_mm + 22.0, 3.0);
      const std::size_t screw = solids.size();
      solids.push_back(capsule_between(tip, head, kScrewRadiusMm, kTitaniumHu));
      solids.push_back(ellipsoid(head, Vector3d::Constant(kHeadRadiusMm), kTitaniumHu));
      give_to_bone(vertebra_name(level), solids, screw);
      heads.push_back(head);
    }
    solids.push_back(capsule_between(heads.front(), heads.back(), kScrewRadiusMm, kTitaniumHu));
  }
}

/// Adds implants that the typical adult lacks. `findings` says what they are.
void add_drawn_implants(const Anatomy& anatomy,
                        bool has_metal,
                        std::vector<Solid>& solids,
                        std::vector<std::string>& findings) {
  if (has_metal || anatomy.has("fusion", 0.2)) {
    const int lowest = static_cast<int>(anatomy.between("lowest screw", -3.0, 1.99, 0.0)) - 1;
    const int highest = lowest + 1 + static_cast<int>(anatomy.between("screws", 0.0, 2.99, 0.0));
    add_screws_and_rods(anatomy, lowest, highest, solids);
    findings.emplace_back("pedicle screws and rods");
  }
  if (anatomy.has("cement", 0.1)) {
    constexpr int kCementHu = 2600;
    const int level = static_cast<int>(anatomy.between("cement level", -3.0, 2.99, 0.0));
    const Vertebra v = vertebra_at(level, anatomy);
    const std::size_t cement = solids.size();
    for (int i = 0; i < 5; ++i)
      solids.push_back(
          ellipsoid(v.center + anatomy.shift3("cement place", 3.5, i),
                    Vector3d::Constant(anatomy.between("cement size", 2.5, 6.0, 4.0, i)),
                    kCementHu));
    give_to_bone(vertebra_name(level), solids, cement);
    findings.emplace_back("bone cement");
  }
  if (anatomy.has("clips", 0.15)) {
    for (int i = 0; i < 5; ++i) {
      const Vector3d clip = Vector3d(-38.0, -52.0, -18.0) + anatomy.shift3("clip", 8.0, i);
      solids.push_back(
          capsule_between(clip,
                          clip + anatomy.shift3("clip axis", 3.0, i) + Vector3d(0.0, 0.0, 4.0),
                          0.7,
                          kTitaniumHu));
    }
    findings.emplace_back("surgical clips");
  }
}

void add_anatomy(const Anatomy& anatomy, std::vector<Solid>& solids) {
  add_soft_tissue(anatomy, solids);
  add_calcifications(anatomy, solids);
  add_ribs(anatomy, solids);
  // There is one more vertebra at each end, which the volume cuts as a scan does.
  for (int level = -kVertebraeEachSide - 1; level <= kVertebraeEachSide; ++level)
    add_disc(level, anatomy, solids);
  for (int level = -kVertebraeEachSide - 1; level <= kVertebraeEachSide + 1; ++level) {
    const std::size_t first = solids.size();
    add_vertebra(vertebra_at(level, anatomy), solids);
    give_to_bone(vertebra_name(level), solids, first);
  }
  add_canal(anatomy, solids);
}

}  // namespace

Phantom spine_phantom(bool has_metal, const Anatomy& anatomy) {
  const Vector3d half_mm = 0.5 * Vector3d(kWidthMm, kWidthMm, kHeightMm);
  Phantom phantom{{}, half_mm, spine_phantom_target(), {}, whole_vertebrae()};
  add_anatomy(anatomy, phantom.solids);
  if (anatomy.is_typical()) {
    if (has_metal) add_screws_and_rods({}, -1, 1, phantom.solids);
    return phantom;
  }
  add_drawn_implants(anatomy, has_metal, phantom.solids, phantom.findings);
  if (std::abs(fractured_level(anatomy)) <= kVertebraeEachSide)
    phantom.findings.emplace_back("an old vertebral fracture");
  constexpr double kWaveMm = 3.0;
  return shaped(std::move(phantom), anatomy, Habitus(anatomy, kWaveMm, true));
}

RegistrationTarget spine_phantom_target() {
  return vertebra_target(0);
}

std::vector<Vector3d> spine_phantom_vertebra_centers() {
  std::vector<Vector3d> centers;
  for (int level = -kVertebraeEachSide; level <= kVertebraeEachSide; ++level)
    centers.push_back(vertebra_at(level).center);
  return centers;
}

}  // namespace af
