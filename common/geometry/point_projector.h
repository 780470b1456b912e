// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "geometry/camera_geometry.h"

namespace af {

/// Projects many points by one camera, with exactly the bits of CameraGeometry's depth_mm() and
/// project(). It computes once what those compute for each point. The camera must outlive it.
class PointProjector {
 public:
  explicit PointProjector(const CameraGeometry& camera)
      : camera_(camera),
        beam_(camera.beam_direction()),
        detector_depth_mm_(camera.source_detector_distance_mm()) {}

  [[nodiscard]] const CameraGeometry& camera() const { return camera_; }
  [[nodiscard]] const Eigen::Vector3d& beam_direction() const { return beam_; }
  [[nodiscard]] double depth_mm(const Eigen::Vector3d& room_point) const {
    return (room_point - camera_.source_point).dot(beam_);
  }
  /// For a point at depth > 0.
  [[nodiscard]] Eigen::Vector2d project(const Eigen::Vector3d& room_point) const {
    const double scale = detector_depth_mm_ / depth_mm(room_point);
    const Eigen::Vector3d from_origin = camera_.source_point +
                                        scale * (room_point - camera_.source_point) -
                                        camera_.detector_origin_point;
    return {from_origin.dot(camera_.column_direction) / camera_.pixel_spacing_mm.x(),
            from_origin.dot(camera_.row_direction) / camera_.pixel_spacing_mm.y()};
  }

 private:
  const CameraGeometry& camera_;
  Eigen::Vector3d beam_;
  double detector_depth_mm_;
};

}  // namespace af
