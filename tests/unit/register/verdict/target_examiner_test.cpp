// SPDX-License-Identifier: Apache-2.0
// The target examined alone: in the X-rays one bone has moved against the others.
#include "register/verdict/target_examiner.h"

#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "drr/bone_volume.h"
#include "drr/part_motion_drr.h"
#include "geometry/tre.h"
#include "unit/register/method/registration_cases.h"

namespace af::registration {
namespace {

using test::five_ellipsoids;
using test::small_case;
using test::SmallCase;

/// Holds all of the second ellipsoid of five_ellipsoids().
const CtBox kTarget{{1, -16, -6}, {23, 0, 26}};

std::shared_ptr<const DrrRenderer> cast_of_target() {
  const AttenuationVolume volume(five_ellipsoids(), {});
  VolumePart part = part_within(volume, kTarget);
  const AttenuationVolume target(
      part.grid, volume.model(), SharedArray<std::uint16_t>(std::move(part.voxels)));
  return std::make_shared<const RayCastDrr>(bone_volume(target), RayCasterOptions{2.0});
}

/// X-rays in which the target has moved against the rest, by `motion` after the gold pose.
SmallCase case_with(const RigidTransform& motion) {
  SmallCase made = small_case();
  const auto cast = cast_of_target();
  made.problem->target_box_ct = kTarget;
  made.problem->target_points_ct = ct_lattice_points(kTarget, 4);
  for (RegistrationView& view : made.problem->views) {
    const View whole = View::whole_detector(view.view.camera);
    PartMotionDrr moved(view.renderer, cast);
    EXPECT_TRUE(moved.hold(made.gold_room_from_ct, whole).is_inside());
    view.xray = render_image(moved, motion * made.gold_room_from_ct, whole);
    view.target_casts = {cast};
  }
  return made;
}

RigidTransform moved_by(const Eigen::Vector3d& translation_mm) {
  return RigidTransform(Eigen::Translation3d(translation_mm));
}

TEST(TargetExaminer, TellsHowFarTheTargetMovedAgainstTheRest) {
  for (const Eigen::Vector3d& way_mm :
       {Eigen::Vector3d(4, 0, 0), Eigen::Vector3d(0, -3, 0), Eigen::Vector3d(0, 0, 5)}) {
    const SmallCase moved = case_with(moved_by(way_mm));
    const TargetEvidence evidence = TargetExaminer(moved.problem).evidence(moved.gold_room_from_ct);
    EXPECT_NEAR(evidence.apart_mm, way_mm.norm(), 0.25) << way_mm.transpose();
  }
}

TEST(TargetExaminer, AgreesWithARigidPatient) {
  const SmallCase rigid = case_with(RigidTransform::Identity());
  const TargetEvidence evidence = TargetExaminer(rigid.problem).evidence(rigid.gold_room_from_ct);
  EXPECT_LT(evidence.apart_mm, 0.05);
  EXPECT_GT(evidence.share, 0.2);
  EXPECT_LE(evidence.share, 1.0);
  EXPECT_FALSE(evidence.has_no_answer);
}

TEST(TargetExaminer, SaysTheSameWhateverItWasAskedBefore) {
  const SmallCase moved = case_with(moved_by({4, 0, 0}));
  const RigidTransform near = moved_by({0.01, 0, 0}) * moved.gold_room_from_ct;
  const RigidTransform far = moved_by({0, 3, 0}) * moved.gold_room_from_ct;
  const TargetEvidence alone = TargetExaminer(moved.problem).evidence(near);
  TargetExaminer asked(moved.problem);
  const TargetEvidence of_far = asked.evidence(far);
  const TargetEvidence of_gold = asked.evidence(moved.gold_room_from_ct);
  const TargetEvidence of_near = asked.evidence(near);
  EXPECT_EQ(of_near.share, alone.share);
  EXPECT_EQ(of_near.apart_mm, alone.apart_mm);
  EXPECT_NE(of_far.share, alone.share);
  // How far the target is apart is measured from the pose itself, not from the lattice's.
  EXPECT_NEAR(of_gold.apart_mm - of_near.apart_mm, 0.01, 0.002);
}

TEST(TargetExaminer, SaysNothingWhereTheTargetCannotBeAsked) {
  const auto is_silent = [](const SmallCase& made) {
    const TargetEvidence evidence = TargetExaminer(made.problem).evidence(made.gold_room_from_ct);
    return evidence.has_no_answer && std::isnan(evidence.share) && std::isnan(evidence.apart_mm);
  };
  SmallCase without_ct = case_with(RigidTransform::Identity());
  without_ct.problem->views.back().target_casts.clear();
  EXPECT_TRUE(is_silent(without_ct));
  SmallCase out_of_sight = case_with(RigidTransform::Identity());
  out_of_sight.problem->target_box_ct = CtBox{{500, 500, 500}, {510, 510, 510}};
  EXPECT_TRUE(is_silent(out_of_sight));
  SmallCase dark = case_with(RigidTransform::Identity());
  for (RegistrationView& view : dark.problem->views)
    view.xray = Image2d(view.xray.width, view.xray.height);
  EXPECT_TRUE(is_silent(dark));
}

TEST(PartMotionDrr, MovesThePartAlone) {
  const SmallCase made = small_case();
  const RegistrationView& view = made.problem->views.front();
  const auto cast = cast_of_target();
  PartMotionDrr drr(view.renderer, cast);
  const RigidTransform& pose = made.gold_room_from_ct;
  EXPECT_TRUE(drr.hold(pose, view.view).is_inside());
  const RigidTransform moved = moved_by({6, 0, 0}) * pose;
  const Image2d whole = render_image(*view.renderer, pose, view.view);
  const Image2d at_pose = render_image(drr, pose, view.view);
  const Image2d apart = render_image(drr, moved, view.view);
  const Image2d before = render_image(*cast, pose, view.view);
  const Image2d after = render_image(*cast, moved, view.view);
  for (std::size_t i = 0; i < whole.pixels.size(); ++i) {
    EXPECT_NEAR(at_pose.pixels[i], whole.pixels[i], 1e-5);
    EXPECT_NEAR(apart.pixels[i] - whole.pixels[i], after.pixels[i] - before.pixels[i], 1e-5);
  }
}

}  // namespace
}  // namespace af::registration
