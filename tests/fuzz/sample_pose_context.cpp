// SPDX-License-Identifier: Apache-2.0
#include "fuzz/sample_pose_context.h"

namespace af::fuzz {

PoseContext sample_pose_context() {
  PoseContext context;
  context.frame = PoseFrame();
  context.ct_grid = [] {
    CtGrid grid;
    grid.size = {20, 30, 40};
    return grid;
  };
  context.rig = [] {
    CameraGeometry camera;
    camera.name = "A";
    camera.source_point = {0.0, -650.0, 0.0};
    camera.row_direction = {0.0, 0.0, -1.0};
    camera.size_px = {200, 180};
    return CameraRig{Eigen::Vector3d::Zero(), {camera}};
  };
  context.ct_frame_of_reference = [] { return std::string("1.2.3.4"); };
  return context;
}

}  // namespace af::fuzz
