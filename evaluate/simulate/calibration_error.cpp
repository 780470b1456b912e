// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/calibration_error.h"

#include <cmath>

#include <Eigen/Geometry>

#include "base/hash_random.h"

namespace af {

namespace {

/// Errors of one camera, in the proportions in which they are drawn.
struct CameraErrors {
  double column_px;
  double row_px;
  double turn_px;      ///< shift of a point 100 px from the detector's middle
  double distance_px;  ///< shift of such a point by magnification
};

constexpr double kLeverPx = 100.0;

CameraGeometry moved(const CameraGeometry& camera, const CameraErrors& errors, double scale) {
  CameraGeometry result = camera;
  const Eigen::Vector3d beam = camera.beam_direction();
  const Eigen::Vector2d middle_px = 0.5 * (camera.size_px.cast<double>() - Eigen::Vector2d::Ones());
  const Eigen::Vector3d middle_point = camera.detector_point(middle_px.x(), middle_px.y());
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(scale * errors.turn_px / kLeverPx, beam).toRotationMatrix();
  result.column_direction = (turn * camera.column_direction).normalized();
  result.row_direction = (turn * camera.row_direction).normalized();
  result.detector_origin_point =
      middle_point + turn * (camera.detector_origin_point - middle_point) +
      scale * (errors.column_px * camera.pixel_spacing_mm.x() * camera.column_direction +
               errors.row_px * camera.pixel_spacing_mm.y() * camera.row_direction);
  result.source_point = camera.source_point + scale * errors.distance_px / kLeverPx *
                                                  camera.source_detector_distance_mm() * beam;
  return result;
}

double rms_shift_px(const CameraGeometry& a,
                    const CameraGeometry& b,
                    const RigidTransform& room_from_ct,
                    const CtBox& box_ct) {
  double sum = 0.0;
  for (const Eigen::Vector3d& corner : box_ct.corner_points())
    sum += (a.project(room_from_ct * corner) - b.project(room_from_ct * corner)).squaredNorm();
  return std::sqrt(sum / static_cast<double>(box_ct.corner_points().size()));
}

}  // namespace

CameraGeometry camera_with_calibration_error(const CameraGeometry& camera,
                                             const RigidTransform& room_from_ct,
                                             const CtBox& box_ct,
                                             double error_px,
                                             std::uint64_t seed,
                                             std::uint64_t key) {
  HashRandom random(seed, key);
  CameraErrors errors{};
  errors.column_px = random.normal();
  errors.row_px = random.normal();
  errors.turn_px = random.normal();
  errors.distance_px = random.normal();
  // The shift is nearly proportional to the scale, so a few corrections reach rounding.
  constexpr int kCorrections = 12;
  constexpr double kFirstScale = 1e-3;
  double scale = kFirstScale;
  for (int i = 0; i < kCorrections; ++i)
    scale *= error_px / rms_shift_px(camera, moved(camera, errors, scale), room_from_ct, box_ct);
  return moved(camera, errors, scale);
}

}  // namespace af
