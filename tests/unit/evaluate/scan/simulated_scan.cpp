// SPDX-License-Identifier: Apache-2.0
#include "unit/evaluate/scan/simulated_scan.h"

#include <cmath>

#include "geometry/rigid_transform.h"

namespace af::test {

std::vector<Ball> lopsided_balls() {
  return {{{0.0, 0.0, 0.0}, 14.0, 0.01},
          {{7.0, 3.0, 6.0}, 3.0, 0.03},
          {{-8.0, 5.0, -4.0}, 2.5, 0.04},
          {{2.0, -9.0, -7.0}, 2.0, 0.05},
          {{-3.0, -5.0, 8.0}, 2.0, 0.04},
          {{9.0, -4.0, 1.0}, 1.5, 0.05}};
}

CircularScan small_scan(AxisAlong axis_along, double step_deg) {
  CircularScan scan;
  scan.source_to_axis_mm = 200.0;
  scan.source_to_detector_mm = 300.0;
  scan.pixel_spacing_mm = {0.9, 0.9};
  scan.size_px = axis_along == AxisAlong::Rows ? Eigen::Vector2i(72, 60) : Eigen::Vector2i(60, 72);
  scan.axis_along = axis_along;
  for (int view = 0; view < 120; ++view)
    scan.angles_rad.push_back((10.0 + step_deg * view) * kRadPerDeg);
  return scan;
}

Image2d ball_image(const CameraGeometry& camera, const std::vector<Ball>& balls) {
  Image2d image(camera.size_px.x(), camera.size_px.y());
  for (int row = 0; row < image.height; ++row)
    for (int column = 0; column < image.width; ++column) {
      double sum = 0.0;
      for (const double right : {-0.25, 0.25})
        for (const double down : {-0.25, 0.25}) {
          const Ray ray = camera.ray(column + right, row + down);
          for (const Ball& ball : balls) {
            const Eigen::Vector3d to_center = ball.center_mm - ray.origin_point;
            const double square =
                ball.radius_mm * ball.radius_mm - to_center.cross(ray.direction).squaredNorm();
            if (square > 0.0) sum += 0.25 * 2.0 * ball.mu_per_mm * std::sqrt(square);
          }
        }
      image.at(column, row) = static_cast<float>(sum);
    }
  return image;
}

ScanImages simulated_scan(const CircularScan& scan,
                          const ScanCalibration& truth,
                          const std::vector<Ball>& balls) {
  ScanImages images;
  images.scan = scan;
  for (const double angle : scan.angles_rad)
    images.line_integrals.push_back(ball_image(scan_camera(scan, truth, angle), balls));
  images.is_lit.assign(images.line_integrals.front().pixels.size(), 1);
  return images;
}

}  // namespace af::test
