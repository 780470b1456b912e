// SPDX-License-Identifier: Apache-2.0
// itk::RayCastInterpolateImageFunction behind plain types: ITK brings an older Eigen, which must
// not meet ours.
#pragma once

#include <array>
#include <memory>
#include <vector>

namespace af::test {

using Triple = std::array<double, 3>;

/// A regular grid of identity direction, because ITK's caster ignores the direction.
struct ItkGrid {
  std::array<int, 3> size = {0, 0, 0};
  Triple spacing_mm = {1, 1, 1};
  Triple origin_mm = {0, 0, 0};
};

/// As RayFan.
struct ItkFan {
  Triple source_point = {0, 0, 0};
  Triple first_point = {0, 0, 0};
  Triple column_step = {0, 0, 0};
  Triple row_step = {0, 0, 0};
  int columns = 0;
  int rows = 0;
};

class ItkRayCaster {
 public:
  /// `mu_per_mm` has one value per grid point, the first axis fastest.
  ItkRayCaster(const ItkGrid& grid, const std::vector<double>& mu_per_mm);
  ~ItkRayCaster();
  ItkRayCaster(const ItkRayCaster&) = delete;
  ItkRayCaster& operator=(const ItkRayCaster&) = delete;

  /// Total attenuation of every ray, row-major.
  [[nodiscard]] std::vector<float> cast(const ItkFan& fan) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace af::test
