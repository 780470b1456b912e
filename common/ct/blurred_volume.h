// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "ct/attenuation_volume.h"

namespace af {

/// Blurs and thins out a CT's attenuation, so that DRRs of it are those of the CT blurred by a
/// given variance along each axis: ray casting's levels of an image pyramid.
///
/// Along each axis every f-th voxel remains, f being the largest whose spacing is at most half of
/// sigma, so that interpolation leaves no trace of where the voxels lie. The weights are (a, 1 -
/// 2a, a), 0 < a <= 1/4, applied n times: their variance 2 a n is exact. Trilinear interpolation of
/// voxels h apart itself blurs by h^2 / 6; the weights blur less by what this adds beyond that of
/// the CT. Weights below a millionth are left out. \test VolumeBlur.SpreadsAVoxelByTheVariance
class VolumeBlur {
 public:
  /// `fine`: grid with border of an AttenuationVolume, which may be a CT that is blurred already,
  /// by `already_mm` < sigma_mm, so that a pyramid of volumes costs little more than its first one.
  /// InputError when the blurred volume would have 2^31 voxels or more.
  VolumeBlur(const CtGrid& fine, double sigma_mm, double already_mm = 0.0);

  /// Grid with border of the blurred volume.
  [[nodiscard]] const CtGrid& grid() const { return grid_; }
  /// Voxels on grid(), in the volume's units and rounded to them. `from` lies on the fine grid.
  void fill(const AttenuationVolume& from, std::span<std::uint16_t> voxels) const;

 private:
  struct Axis {
    int factor = 1;
    int first = 0;               ///< fine index of the first coarse voxel
    std::vector<float> weights;  ///< 2 radius() + 1

    [[nodiscard]] int radius() const { return static_cast<int>(weights.size() / 2); }
    /// Fine index of the first weight of a coarse voxel; may be negative.
    [[nodiscard]] int first_of(int coarse) const { return first + coarse * factor - radius(); }
  };
  static Axis make_axis(double spacing_mm, double sigma_mm, double already_mm);

  std::array<int, 3> fine_size_;
  std::array<Axis, 3> axes_;
  CtGrid grid_;
};

/// The blurred volume, in memory of this process; arguments as of VolumeBlur.
std::shared_ptr<const AttenuationVolume> blurred_volume(const AttenuationVolume& volume,
                                                        double sigma_mm,
                                                        double already_mm = 0.0);

}  // namespace af
