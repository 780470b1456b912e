// SPDX-License-Identifier: Apache-2.0
#include "geometry/lens_distortion.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include "geometry/pinhole_camera.h"

namespace af {
namespace {

/// f of the model, and its derivative with respect to r2.
struct RadialFactor {
  double value;
  double slope;
  double denominator;
};

RadialFactor radial_factor(const std::array<double, 8>& k, double r2) {
  const double above = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
  const double above_slope = k[0] + r2 * (2.0 * k[1] + r2 * 3.0 * k[4]);
  const double below = 1.0 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]));
  const double below_slope = k[5] + r2 * (2.0 * k[6] + r2 * 3.0 * k[7]);
  return {above / below, (above_slope * below - above * below_slope) / (below * below), below};
}

/// False where the image is mirrored in one direction or, behind a second fold, in both.
bool keeps_its_sides(const Eigen::Matrix2d& jacobian) {
  return jacobian.determinant() > 0.0 && jacobian.trace() > 0.0;
}

}  // namespace

bool LensDistortion::is_none() const {
  return std::ranges::all_of(coefficients, [](double k) { return k == 0.0; });
}

std::size_t LensDistortion::count() const {
  if (is_none()) return 0;
  const bool is_rational =
      coefficients[5] != 0.0 || coefficients[6] != 0.0 || coefficients[7] != 0.0;
  return is_rational ? 8 : 5;
}

Eigen::Vector2d LensDistortion::distorted(const Eigen::Vector2d& at) const {
  const double r2 = at.squaredNorm();
  const double f = radial_factor(coefficients, r2).value;
  const double p1 = coefficients[2];
  const double p2 = coefficients[3];
  const double xy = at.x() * at.y();
  return {at.x() * f + 2.0 * p1 * xy + p2 * (r2 + 2.0 * at.x() * at.x()),
          at.y() * f + p1 * (r2 + 2.0 * at.y() * at.y()) + 2.0 * p2 * xy};
}

Eigen::Matrix2d LensDistortion::jacobian(const Eigen::Vector2d& at) const {
  const RadialFactor f = radial_factor(coefficients, at.squaredNorm());
  const double p1 = coefficients[2];
  const double p2 = coefficients[3];
  const double x = at.x();
  const double y = at.y();
  const double across = 2.0 * (x * y * f.slope + p1 * x + p2 * y);
  Eigen::Matrix2d jacobian;
  jacobian << f.value + 2.0 * x * x * f.slope + 2.0 * p1 * y + 6.0 * p2 * x, across, across,
      f.value + 2.0 * y * y * f.slope + 6.0 * p1 * y + 2.0 * p2 * x;
  return jacobian;
}

LensDistortion LensDistortion::with_rows_flipped() const {
  LensDistortion flipped = *this;
  flipped.coefficients[2] = -flipped.coefficients[2];
  flipped.coefficients[3] = -flipped.coefficients[3];
  return flipped;
}

PixelDistortion::PixelDistortion(const CameraGeometry& camera) : lens_(camera.distortion) {
  const Eigen::Matrix3d k = pinhole_of(camera).pixels_from_camera;
  focal_px_ = k.diagonal().head<2>();
  center_px_ = k.topRightCorner<2, 1>();
}

Eigen::Vector2d PixelDistortion::normalised(const Eigen::Vector2d& pixel) const {
  return (pixel - center_px_).cwiseQuotient(focal_px_);
}

Eigen::Vector2d PixelDistortion::stored_from_ideal(const Eigen::Vector2d& pixel) const {
  return lens_.distorted(normalised(pixel)).cwiseProduct(focal_px_) + center_px_;
}

std::optional<Eigen::Vector2d> PixelDistortion::ideal_from_stored(
    const Eigen::Vector2d& pixel) const {
  // Newton's method from the stored place: real lenses need three or four steps.
  constexpr int kMostSteps = 50;
  constexpr double kExactPx = 1e-9;
  const Eigen::Vector2d wanted = normalised(pixel);
  Eigen::Vector2d at = wanted;
  for (int step = 0; step < kMostSteps; ++step) {
    const Eigen::Vector2d missing = wanted - lens_.distorted(at);
    const Eigen::Matrix2d jacobian = lens_.jacobian(at);
    if (!missing.allFinite() || !keeps_its_sides(jacobian)) return std::nullopt;
    if (missing.cwiseProduct(focal_px_).norm() <= kExactPx)
      return at.cwiseProduct(focal_px_) + center_px_;
    at += jacobian.inverse() * missing;
  }
  return std::nullopt;
}

bool PixelDistortion::is_one_to_one_at(const Eigen::Vector2d& pixel) const {
  const Eigen::Vector2d at = normalised(pixel);
  return radial_factor(lens_.coefficients, at.squaredNorm()).denominator > 0.0 &&
         keeps_its_sides(lens_.jacobian(at));
}

std::string distortion_problem(const CameraGeometry& camera) {
  const auto& k = camera.distortion.coefficients;
  constexpr double kMost = 1e6;
  if (!std::ranges::all_of(k, [](double value) { return std::abs(value) <= kMost; }))
    return "must be finite and within 1e6";
  if (camera.distortion.is_none()) return "";
  const PixelDistortion distortion(camera);
  constexpr int kSteps = 32;
  for (int row = 0; row <= kSteps; ++row)
    for (int column = 0; column <= kSteps; ++column) {
      const Eigen::Vector2d share(static_cast<double>(column) / kSteps,
                                  static_cast<double>(row) / kSteps);
      const Eigen::Vector2d pixel =
          share.cwiseProduct(camera.size_px.cast<double>()) - Eigen::Vector2d(0.5, 0.5);
      if (!distortion.is_one_to_one_at(pixel))
        return "must not fold the image; it does near column " +
               std::to_string(std::lround(pixel.x())) + ", row " +
               std::to_string(std::lround(pixel.y()));
    }
  return "";
}

}  // namespace af
