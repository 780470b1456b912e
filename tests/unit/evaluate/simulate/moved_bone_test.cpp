// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/moved_bone.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <ranges>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "base/hash_random.h"
#include "evaluate/simulate/phantom.h"
#include "evaluate/simulate/solid_chords.h"
#include "evaluate/simulate/solid_projector.h"

namespace af {
namespace {

using Eigen::Vector3d;

struct Subject {
  std::string phantom;
  std::string bone;
};

void PrintTo(const Subject& subject, std::ostream* out) {
  *out << subject.phantom << ' ' << subject.bone;
}

/// Every bone of every phantom.
std::vector<Subject> subjects() {
  std::vector<Subject> all;
  for (const std::string& name : phantom_names())
    for (const PhantomBone& bone : make_phantom(name, false).bones)
      all.push_back({name, std::string(bone.name)});
  return all;
}

constexpr std::int64_t kPatient = 4;
const Vector3d source_point(420.0, -640.0, 35.0);

const TissueModel& patient_tissue() {
  static const TissueModel model{AttenuationModel()};
  return model;
}

const PhantomBone& bone_of(const Phantom& phantom, const std::string& name) {
  return *std::ranges::find(phantom.bones, name, &PhantomBone::name);
}

RigidTransform drawn_motion(const Phantom& phantom, const std::string& bone, std::uint64_t seed) {
  return drawn_rest_from_bone(
      phantom, bone, bone_of(phantom, bone).target.center_ct_mm, seed, hash_name("bone"));
}

/// The bodies of a bone alone, in air.
Phantom alone(Phantom phantom, const std::string& bone) {
  std::erase_if(phantom.solids, [&](const Solid& solid) { return solid.bone != bone; });
  return phantom;
}

/// HU without texture; air outside all bodies.
int hu_at(const Phantom& phantom, const Vector3d& point) {
  for (const Solid& solid : std::views::reverse(phantom.solids))
    if (solid.contains(point)) return solid.hu;
  return kGasHu;
}

/// A point drawn uniformly from the body's box; none when it misses the body.
std::optional<Vector3d> drawn_point(const Solid& solid, HashRandom& random) {
  const double x = random.uniform(-1.0, 1.0);
  const double y = random.uniform(-1.0, 1.0);
  const double z = random.uniform(-1.0, 1.0);
  const Vector3d point =
      solid.center_mm + solid.rotation * solid.reach_mm().cwiseProduct(Vector3d(x, y, z));
  if (!solid.contains(point)) return std::nullopt;
  return point;
}

/// Points of a plane through the bone, for rays from source_point to pass through.
std::vector<Vector3d> screen(const PhantomBone& bone) {
  constexpr double kStepMm = 4.0;
  constexpr double kReachMm = 100.0;
  const Vector3d along = (bone.target.center_ct_mm - source_point).normalized();
  const Vector3d across = along.cross(Vector3d::UnitZ()).normalized();
  std::vector<Vector3d> points;
  for (double u = -kReachMm; u <= kReachMm; u += kStepMm)
    for (double v = -kReachMm; v <= kReachMm; v += kStepMm)
      points.push_back(bone.target.center_ct_mm + u * across + v * across.cross(along));
  return points;
}

bool is_hit(const Phantom& phantom, const Vector3d& through) {
  const Vector3d direction = (through - source_point).normalized();
  return std::ranges::any_of(phantom.solids, [&](const Solid& solid) {
    return chords(solid, source_point, direction).count > 0;
  });
}

class EveryMovedBone : public ::testing::TestWithParam<Subject> {
 protected:
  const std::string bone_ = GetParam().bone;
  const Phantom still_ = make_phantom(GetParam().phantom, false, kPatient);
  const RigidTransform rest_from_bone_ = drawn_motion(still_, bone_, 7);
  const Phantom moved_ = with_moved_bone(still_, bone_, rest_from_bone_);
};

TEST_P(EveryMovedBone, DiffersWithinItsShadowsAndNowhereElse) {
  const SolidProjector before(still_, patient_tissue());
  const SolidProjector after(moved_, patient_tissue());
  const Phantom old_bodies = alone(still_, bone_);
  const Phantom new_bodies = alone(moved_, bone_);
  int differ = 0;
  int shaded = 0;
  int beside = 0;
  for (const Vector3d& through : screen(bone_of(still_, bone_))) {
    const PathIntegrals a = before.integrate(source_point, through);
    const PathIntegrals b = after.integrate(source_point, through);
    if (!is_hit(old_bodies, through) && !is_hit(new_bodies, through)) {
      EXPECT_EQ(a.water_mm, b.water_mm);
      EXPECT_EQ(a.bone_mm, b.bone_mm);
      ++beside;
      continue;
    }
    ++shaded;
    differ += std::abs(a.water_mm + a.bone_mm - b.water_mm - b.bone_mm) > 0.01 ? 1 : 0;
  }
  EXPECT_GT(beside, 100);
  EXPECT_GT(shaded, 50);
  EXPECT_GT(differ, shaded * 3 / 4);
}

TEST_P(EveryMovedBone, IsSeenByARayWhereItsPoseSaysIt) {
  // The moved bone in the pose of the rest is the unmoved one in the gold pose, with its texture. A
  // ray takes some hundred steps of up to 1.5 mm. A few of them may round to another HU: 0.0015 mm
  // each.
  constexpr double kToleranceMm = 0.02;
  Phantom old_bodies = alone(still_, bone_);
  Phantom new_bodies = alone(moved_, bone_);
  for (Phantom* bodies : {&old_bodies, &new_bodies})  // no faces
    bodies->half_sizes_mm = Vector3d::Constant(500.0);
  const SolidProjector before(old_bodies, patient_tissue());
  const SolidProjector after(new_bodies, patient_tissue());
  const RigidTransform bone_from_rest = rest_from_bone_.inverse();
  int differ = 0;
  for (const Vector3d& through : screen(bone_of(still_, bone_))) {
    const PathIntegrals moved = after.integrate(source_point, through);
    const PathIntegrals gold =
        before.integrate(bone_from_rest * source_point, bone_from_rest * through);
    EXPECT_NEAR(moved.water_mm, gold.water_mm, kToleranceMm);
    EXPECT_NEAR(moved.bone_mm, gold.bone_mm, kToleranceMm);
    const PathIntegrals flipped =
        before.integrate(rest_from_bone_ * source_point, rest_from_bone_ * through);
    differ += std::abs(flipped.bone_mm - moved.bone_mm) > 0.1 ? 1 : 0;
  }
  EXPECT_GT(differ, 30);
}

TEST_P(EveryMovedBone, LeavesSoftTissueWhereItWas) {
  constexpr int kLowestSoftHu = -200;
  HashRandom random(5);
  for (const Solid& solid : still_.solids) {
    if (solid.bone != bone_) continue;
    for (int i = 0; i < 40; ++i) {
      const std::optional<Vector3d> point = drawn_point(solid, random);
      if (!point || hu_at(still_, *point) < kLowestSoftHu) continue;
      EXPECT_GT(hu_at(moved_, *point), kLowestSoftHu) << point->transpose();
    }
  }
}

TEST_P(EveryMovedBone, HardlyRunsIntoWhatStays) {
  // At joints some bodies overlap at rest, too. 3 % are 0.2 mm of a plate that is 7 mm thick.
  constexpr double kMostShare = 0.03;
  Phantom rest = still_;
  std::erase_if(rest.solids, [&](const Solid& solid) { return solid.bone == bone_; });
  HashRandom random(3);
  int inside = 0;
  int blocked = 0;
  for (const Solid& solid : still_.solids) {
    if (solid.bone != bone_) continue;
    for (int i = 0; i < 10; ++i) {
      const std::optional<Vector3d> point = drawn_point(solid, random);
      if (!point) continue;
      ++inside;
      blocked += (hu_at(rest, rest_from_bone_ * *point) >= kBoneHu ? 1 : 0) -
                 (hu_at(rest, *point) >= kBoneHu ? 1 : 0);
    }
  }
  EXPECT_LT(blocked, kMostShare * inside);
}

INSTANTIATE_TEST_SUITE_P(Bones,
                         EveryMovedBone,
                         ::testing::ValuesIn(subjects()),
                         [](const auto& instance) {
                           std::string name = instance.param.phantom + instance.param.bone;
                           std::erase(name, '-');
                           return name;
                         });

TEST(MovedBone, TurnsAndShiftsByWhatIsStated) {
  const Phantom phantom = make_phantom("pelvis", false, kPatient);
  const Vector3d center = bone_of(phantom, "left-femur").target.center_ct_mm;
  std::set<double> shifts_mm;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    const RigidTransform motion = drawn_motion(phantom, "left-femur", seed);
    const double turn_deg =
        rotation_angle_between_rad(RigidTransform::Identity(), motion) * kDegPerRad;
    const double shift_mm = (motion * center - center).norm();
    EXPECT_GE(turn_deg, 2.0 - 1e-9);
    EXPECT_LE(turn_deg, 5.0 + 1e-9);
    EXPECT_GE(shift_mm, 2.0 - 1e-9);
    EXPECT_LE(shift_mm, 6.0 + 1e-9);
    EXPECT_TRUE(motion.isApprox(drawn_motion(phantom, "left-femur", seed), 0.0)) << seed;
    shifts_mm.insert(shift_mm);
  }
  EXPECT_EQ(shifts_mm.size(), 8u);
}

TEST(MovedBone, TakesItsImplantsAlong) {
  // In a patient with a prosthesis all metal of the femur goes, and the cup stays.
  const Phantom phantom = make_phantom("pelvis", true, kPatient);
  const auto is_metal = [](const Solid& solid) { return solid.hu >= kTitaniumHu; };
  const Phantom femur = alone(phantom, "left-femur");
  EXPECT_EQ(std::ranges::count_if(femur.solids, is_metal), 4);  // neck, ball, two parts of the stem
  EXPECT_GT(std::ranges::count_if(phantom.solids, is_metal), 4);
}

}  // namespace
}  // namespace af
