// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <string>
#include <tuple>

#include <Eigen/Core>

namespace af {

struct CameraGeometry;

/// OpenCV's model of a distorting lens (or image intensifier). A point at (x, y) = (X / Z, Y / Z)
/// in the camera's frame, with r2 = x^2 + y^2 and f = (1 + k1 r2 + k2 r2^2 + k3 r2^3) / (1 + k4 r2
/// + k5 r2^2 + k6 r2^3), appears at
///   (x f + 2 p1 x y + p2 (r2 + 2 x^2), y f + p1 (r2 + 2 y^2) + 2 p2 x y).
struct LensDistortion {
  std::array<double, 8> coefficients{};  ///< k1, k2, p1, p2, k3, k4, k5, k6

  auto members() { return std::tie(coefficients); }

  [[nodiscard]] bool is_none() const;
  /// How many coefficients are written: 0, 5 or 8.
  [[nodiscard]] std::size_t count() const;
  [[nodiscard]] Eigen::Vector2d distorted(const Eigen::Vector2d& at) const;
  /// Derivative of distorted() with respect to `at`; not finite where the denominator of f is 0.
  [[nodiscard]] Eigen::Matrix2d jacobian(const Eigen::Vector2d& at) const;
  /// The same lens for images whose rows run the other way: PinholeCamera then reverses x and y.
  [[nodiscard]] LensDistortion with_rows_flipped() const;

  bool operator==(const LensDistortion&) const = default;
};

/// Maps between ideal pixels, those of a camera without distortion, and pixels of its stored,
/// distorted images. Only X-ray files hold the latter. K is that of pinhole_of(camera).
class PixelDistortion {
 public:
  explicit PixelDistortion(const CameraGeometry& camera);

  /// Where the stored image shows what the undistorted image shows at (column, row).
  [[nodiscard]] Eigen::Vector2d stored_from_ideal(const Eigen::Vector2d& pixel) const;
  /// The reverse, to 1e-9 px; nullopt where the lens shows no point.
  [[nodiscard]] std::optional<Eigen::Vector2d> ideal_from_stored(
      const Eigen::Vector2d& pixel) const;
  /// Whether neighbours stay neighbours at an ideal pixel: the image is not folded there.
  [[nodiscard]] bool is_one_to_one_at(const Eigen::Vector2d& pixel) const;

 private:
  [[nodiscard]] Eigen::Vector2d normalised(const Eigen::Vector2d& pixel) const;

  LensDistortion lens_;
  Eigen::Vector2d focal_px_;
  Eigen::Vector2d center_px_;
};

/// Why a camera cannot have its distortion. Empty when it can: coefficients are finite, and no part
/// of the image is folded.
std::string distortion_problem(const CameraGeometry& camera);

}  // namespace af
