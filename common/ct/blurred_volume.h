// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "ct/attenuation_volume.h"

namespace af {

/// Blurs and thins out a CT's attenuation, so that its DRRs are those of the CT blurred by a given
/// variance along each axis. Ray casting uses it for the levels of an image pyramid.
///
/// Along each axis every f-th voxel remains, where f is the largest whose spacing is at most half
/// of sigma, so that interpolation leaves no trace of where the voxels lie. The weights are (a, 1 -
/// 2a, a), 0 < a <= 1/4, applied n times: their variance 2 a n is exact. Trilinear interpolation of
/// voxels h apart itself blurs by h^2 / 6. The weights blur less by what this adds beyond that of
/// the CT. Weights below a millionth are left out. \test VolumeBlur.SpreadsAVoxelByTheVariance
class VolumeBlur {
 public:
  /// `fine`: the bordered grid of an AttenuationVolume. That may be a CT already blurred by
  /// `already_mm` < sigma_mm, so that a pyramid of volumes costs little more than its first one.
  /// Throws InputError when the blurred volume would have 2^31 voxels or more.
  VolumeBlur(const CtGrid& fine, double sigma_mm, double already_mm = 0.0);

  /// The bordered grid of the blurred volume.
  [[nodiscard]] const CtGrid& grid() const { return grid_; }
  /// Writes voxels on grid(), in the volume's units and rounded to them. `from` lies on the fine
  /// grid.
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

/// The blurred volume, in memory of this process. Arguments are those of VolumeBlur.
std::shared_ptr<const AttenuationVolume> blurred_volume(const AttenuationVolume& volume,
                                                        double sigma_mm,
                                                        double already_mm = 0.0);

}  // namespace af
