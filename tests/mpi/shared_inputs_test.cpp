// SPDX-License-Identifier: Apache-2.0
#include "study/shared_inputs.h"

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "files/output_file.h"
#include "study/rig_file.h"
#include "support/shared_folder.h"

namespace af {
namespace {

const char* const kStudy = R"(rig = "rig.toml"
[[case]]
name = "skull-01"
ct = "ct.nii.gz"
nominal_room_from_ct = [[1,0,0,10],[0,0,-1,20],[0,1,0,30],[0,0,0,1]]
center_ct_mm = [0.1, 2.0, 3.0]
target_box_ct_mm = [[-30,-31,-32],[30,31,32]]
gold_room_from_ct = [[1,0,0,11],[0,0,-1,20],[0,1,0,30],[0,0,0,1]]
[[case.view]]
camera = "A"
xray = "A.mha"
xray_domain = "intensity"
roi_px = [150, 160, 200, 201]
)";

TEST(SharedInputs, StudyAndRigAreReadByRankZeroAlone) {
  const Communicator world = Communicator::world();
  const test::SharedFolder folder;
  if (world.is_root()) {
    CameraRig rig = read_rig("treatment-room");
    rig.isocenter_point.x() = 1.0 / 3.0;
    write_text_file(folder / "rig.toml", rig_to_toml(rig));
    write_text_file(folder / "study.toml", kStudy);
  }
  // The other ranks have no file to read.
  const Shared<Study> study = shared_study(
      world.is_root() ? folder / "study.toml" : std::filesystem::path("/nowhere/study.toml"),
      world);
  EXPECT_EQ(study->rig.isocenter_point.x(), 1.0 / 3.0);
  EXPECT_EQ(study->rig.camera("A").size_px, read_rig("treatment-room").camera("A").size_px);
  ASSERT_EQ(study->cases.size(), 1U);
  EXPECT_EQ(study->cases.front().center_ct_mm.x(), 0.1);
  EXPECT_EQ(study->cases.front().views.front().roi.height, 201);
  // This holds everything that the file says, and its lines. A member that is not sent would be
  // missing here.
  const Study read = read_study(folder / "study.toml");
  EXPECT_EQ(study_to_toml(study, {}), study_to_toml(read, {}));
  EXPECT_EQ(study->path, read.path);
  EXPECT_EQ(study->rig_name_or_path, read.rig_name_or_path);
  EXPECT_EQ(study->cases.front().places, read.cases.front().places);
  EXPECT_EQ(study->cases.front().views.front().places, read.cases.front().views.front().places);
}

TEST(SharedInputs, RigsAndPosesAreReadByRankZeroAlone) {
  const Communicator world = Communicator::world();
  const test::SharedFolder folder;
  CameraRig rig = read_rig("c-arm-12in");
  rig.isocenter_point.x() = 1.0 / 3.0;
  if (world.is_root()) write_text_file(folder / "rig.toml", rig_to_toml(rig));
  const std::string here = (folder / "rig.toml").string();
  const CameraRig read = shared_rig(world.is_root() ? here : "/nowhere/rig.toml", world);
  EXPECT_EQ(rig_to_toml(read), rig_to_toml(rig));

  RigidTransform pose = RigidTransform::Identity();
  pose.translation() = Eigen::Vector3d(1.0 / 3.0, -0.0, 1e-300);
  int calls = 0;
  const auto read_two = [&] {
    ++calls;
    return std::vector{RigidTransform(RigidTransform::Identity()), pose};
  };
  const std::vector<RigidTransform> poses = shared_poses(world, read_two);
  EXPECT_EQ(calls, world.is_root() ? 1 : 0);
  ASSERT_EQ(poses.size(), 2U);
  EXPECT_EQ(poses[1].matrix(), pose.matrix());
  EXPECT_TRUE(std::signbit(poses[1].translation().y()));
  EXPECT_TRUE(shared_poses(world, [] { return std::vector<RigidTransform>(); }).empty());
}

TEST(SharedInputs, WhatRankZeroCannotReadIsTheSameErrorOnEveryRank) {
  const Communicator world = Communicator::world();
  try {
    static_cast<void>(shared_study("/nowhere/study.toml", world));
    ADD_FAILURE() << "no error on rank " << world.rank();
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::File);
  }
  EXPECT_THROW(static_cast<void>(shared_rig("/nowhere/rig.toml", world)), Error);
  EXPECT_THROW(static_cast<void>(shared_poses(
                   world, []() -> std::vector<RigidTransform> { throw FileError("p", "torn"); })),
               Error);
}

TEST(SharedInputs, ImagesReachEveryRankToTheLastBit) {
  const Communicator world = Communicator::world();
  Image2d image;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  if (world.is_root()) {
    image = Image2d(3, 2);
    image.pixels = {0.1F, -0.0F, nan, std::numeric_limits<float>::denorm_min(), 1e30F, 7.0F};
  }
  image = on_root(world, [&] { return image; }).share().take();
  ASSERT_EQ(image.width, 3);
  ASSERT_EQ(image.height, 2);
  ASSERT_EQ(image.pixels.size(), 6U);
  EXPECT_EQ(image.pixels[0], 0.1F);
  EXPECT_TRUE(std::signbit(image.pixels[1]));
  EXPECT_TRUE(std::isnan(image.pixels[2]));
  EXPECT_EQ(image.pixels[3], std::numeric_limits<float>::denorm_min());
  EXPECT_TRUE(on_root(world, [] { return Image2d(); }).share()->pixels.empty());
}

}  // namespace
}  // namespace af
