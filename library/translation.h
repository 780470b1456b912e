// SPDX-License-Identifier: Apache-2.0
// Translates between the library's types, which include only the standard library, and the
// programs'.
#pragma once

#include <string>
#include <type_traits>

#include "attenuation_fields/beam.h"
#include "attenuation_fields/ct.h"
#include "attenuation_fields/geometry.h"
#include "ct/ct_volume.h"
#include "drr/xray_beam.h"
#include "files/reading_turn.h"
#include "geometry/camera_geometry.h"
#include "geometry/rigid_transform.h"

namespace af::library {

namespace api = attenuation_fields;

Eigen::Vector3d vector_of(const api::Vector3& values);
api::Vector3 vector_of(const Eigen::Vector3d& vector);
/// Throws InputError naming `name` when the matrix is not rigid. A rigid one keeps its bits.
RigidTransform transform_of(const api::Pose& pose, const std::string& name);
api::Pose pose_of(const RigidTransform& transform);
/// Throws InputError when the camera has problems.
CameraGeometry checked_camera(const api::Camera& camera);
api::Camera camera_of(const CameraGeometry& camera);
/// Throws InputError when the rotation is not a rotation.
PoseFrame checked_frame(const api::PoseFrame& frame);
api::PoseFrame frame_of(const PoseFrame& frame);
/// Throws InputError when the beam has problems.
XrayBeamOptions checked_beam(const api::Beam& beam);
CtGrid grid_of(const api::CtGrid& grid);
api::CtGrid grid_of(const CtGrid& grid);

/// Throws the error that is being handled as one of the library's, with its text.
[[noreturn]] void throw_translated();

/// Runs `function`. Errors leave it as the library's.
template <typename Function>
std::invoke_result_t<Function> translated(Function&& function) {
  try {
    return function();
  } catch (...) {
    throw_translated();
  }
}

/// The same, while no other thread of this process does so.
template <typename Function>
std::invoke_result_t<Function> translated_reading(Function&& function) {
  return translated([&] {
    const ReadingTurn turn;
    return function();
  });
}

}  // namespace af::library
