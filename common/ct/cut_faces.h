// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Core>

#include "ct/attenuation_volume.h"

namespace af {

/// Where the CT (of which `box` is the attenuating_box()) ends but the body goes on: centres (ct
/// frame, mm) of the attenuating voxels of the outermost layers that are cuts, at most a few
/// thousand of them. An outermost layer (of the attenuating part) is a cut when it attenuates over
/// half as much area as the layer 2 mm further in: a shaft that the scan or a segmentation cut
/// through does, a rounded end that the CT is cropped to does not. \test
/// CutFaces.AreWhereAShaftIsCutAndNotWhereABodyEnds
std::vector<Eigen::Vector3d> cut_points(const CtVolume& ct,
                                        const AttenuationModel& model,
                                        const AttenuatingBox& box);

}  // namespace af
