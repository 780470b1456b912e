// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "ct/attenuation_volume.h"
#include "ct/ct_identity.h"
#include "ct/ct_read_options.h"
#include "field/attenuation_quantizer.h"
#include "geometry/camera_geometry.h"
#include "geometry/rigid_transform.h"
#include "geometry/slab_sizing.h"
#include "precompute/build/precompute_options.h"
#include "precompute/measured_views.h"
#include "ranks/communicator.h"

namespace af {

/// What a field is made from: the CT's attenuation (held once per node), the camera, the nominal
/// pose.
struct FieldSource {
  std::shared_ptr<const AttenuationVolume> volume;
  std::string ct_path;
  CtReadOptions ct_reading;  ///< as typed, or the study's
  CtIdentity ct;
  CameraGeometry camera;
  PoseFrame frame;
  Eigen::Vector3d isocenter_point = Eigen::Vector3d::Zero();  ///< of the rig
  MotionRange range;                         ///< about the nominal pose, from the options
  std::vector<HalfSpace> sources;            ///< which of its poses to hold: LightSlabSpec::sources
  std::vector<CameraGeometry> more_cameras;  ///< whose rays the field holds too
  std::shared_ptr<const MeasuredViews> projections;  ///< for correcting the field; null: none

  [[nodiscard]] AttenuationQuantizer quantizer() const {
    return AttenuationQuantizer::for_maximum(volume->max_total_attenuation());
  }
};

/// Collective. Reads what the options name, and prints remarks about it. Throws UsageError when
/// they name too little, and as the readers do.
FieldSource load_source(const PrecomputeOptions& options, const Communicator& communicator);

}  // namespace af
