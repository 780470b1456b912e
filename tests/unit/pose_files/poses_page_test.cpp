// SPDX-License-Identifier: Apache-2.0
// docs/poses.md: every example of the page is the pose that the page describes.
#include <fstream>
#include <sstream>

#include <gtest/gtest.h>

#include "pose_files/pose_file.h"
#include "support/io_checks.h"

namespace af {
namespace {

/// The blocks of the page behind "<!-- example: NAME -->", by name.
std::vector<std::pair<std::string, std::string>> examples_of_page() {
  std::ifstream page(AF_POSES_PAGE);
  std::vector<std::pair<std::string, std::string>> examples;
  const std::string mark = "<!-- example: ";
  for (std::string line; std::getline(page, line);) {
    if (!line.starts_with(mark)) continue;
    const std::string name = line.substr(mark.size(), line.find(' ', mark.size()) - mark.size());
    std::getline(page, line);  // ```toml
    std::string text;
    while (std::getline(page, line) && line != "```") text += line + "\n";
    examples.emplace_back(name, text);
  }
  return examples;
}

/// The CT and the camera that the page states.
PoseContext context_of_page() {
  PoseContext context;
  context.ct_grid = [] {
    CtGrid grid;
    grid.size = {20, 30, 40};
    grid.spacing_mm = {0.5, 0.75, 2.0};
    grid.origin_mm = {-4.75, -10.875, -39.0};
    return grid;
  };
  context.rig = [] {
    CameraGeometry camera;
    camera.name = "A";
    camera.source_point = {0.0, -650.0, 0.0};
    camera.detector_origin_point = {-100.0, 370.0, 90.0};
    camera.row_direction = {0.0, 0.0, -1.0};
    camera.size_px = {200, 180};
    return CameraRig{Eigen::Vector3d::Zero(), {camera}};
  };
  return context;
}

TEST(PosesPage, EveryExampleIsThePoseThatItDescribes) {
  const test::ScratchFolder folder;
  const auto examples = examples_of_page();
  EXPECT_EQ(examples.size(), 6U);
  EXPECT_LT(context_of_page().ct_grid().center_mm().norm(), 1e-12);
  for (const auto& [name, text] : examples) {
    test::write_input(folder / name, text);
    const RigidTransform pose = read_pose(folder / name, context_of_page());
    EXPECT_LT((pose * Eigen::Vector3d(1, 2, 3) - Eigen::Vector3d(8, 21, 33)).norm(), 1e-12) << name;
    EXPECT_LT((pose * Eigen::Vector3d(0, 0, 0) - Eigen::Vector3d(10, 20, 30)).norm(), 1e-12)
        << name;
    EXPECT_LT((pose * Eigen::Vector3d(5, 0, 0) - Eigen::Vector3d(10, 25, 30)).norm(), 1e-12)
        << name;
  }
}

}  // namespace
}  // namespace af
