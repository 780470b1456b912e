// SPDX-License-Identifier: Apache-2.0
#include "ct/blurred_volume.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.h"

namespace af {

namespace {

/// Variance of one pass of (1 2 1)/4, in voxels squared.
constexpr double kMostVariancePerPass = 0.5;

std::vector<float> weights_of_variance(double variance) {
  const int passes = static_cast<int>(std::ceil(variance / kMostVariancePerPass));
  const double side = passes > 0 ? variance / (2.0 * passes) : 0.0;
  std::vector<double> weights{1.0};
  for (int pass = 0; pass < passes; ++pass) {
    std::vector<double> wider(weights.size() + 2, 0.0);
    for (std::size_t i = 0; i < weights.size(); ++i) {
      wider[i] += side * weights[i];
      wider[i + 1] += (1.0 - 2.0 * side) * weights[i];
      wider[i + 2] += side * weights[i];
    }
    weights = std::move(wider);
  }
  return {weights.begin(), weights.end()};
}

/// Which of `count` samples a window of weights that begins at `first` meets.
struct Overlap {
  int begin, end;  ///< of the weights
};

Overlap overlap(int first, std::size_t weights, int count) {
  return {std::max(0, -first), std::min(static_cast<int>(weights), count - first)};
}

}  // namespace

VolumeBlur::Axis VolumeBlur::make_axis(double spacing_mm, double sigma_mm) {
  Axis axis;
  axis.factor = std::max(1, static_cast<int>(0.5 * sigma_mm / spacing_mm));
  const double interpolation = (axis.factor * axis.factor - 1) / 6.0;
  axis.weights = weights_of_variance(std::pow(sigma_mm / spacing_mm, 2) - interpolation);
  // The outermost voxels of the fine volume are 0; so is the first voxel of the coarse one.
  axis.first = -axis.radius();
  return axis;
}

VolumeBlur::VolumeBlur(const CtGrid& fine, double sigma_mm) : fine_size_(fine.size), grid_(fine) {
  check(sigma_mm > 0.0, "a blur needs a positive sigma");
  Eigen::Vector3d first;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    axes_[i] = make_axis(fine.spacing_mm[at], sigma_mm);
    const Axis& axis = axes_[i];
    first[at] = axis.first;
    grid_.spacing_mm[at] = axis.factor * fine.spacing_mm[at];
    const int reach = fine.size[i] - 1 + 2 * axis.radius();
    grid_.size[i] = (reach + axis.factor - 1) / axis.factor + 1;
  }
  grid_.origin_mm = fine.point_mm(first);
  require_castable(grid_);
}

/// One slice along i and j: `blurred` has the coarse grid's columns and rows.
void VolumeBlur::blur_slice(const std::uint16_t* slice,
                            std::vector<float>& along_rows,
                            std::vector<float>& blurred) const {
  const int width = grid_.size[0];
  const Axis& x = axes_[0];
  for (int j = 0; j < fine_size_[1]; ++j) {
    const std::uint16_t* row = slice + static_cast<std::ptrdiff_t>(j) * fine_size_[0];
    float* to = along_rows.data() + static_cast<std::ptrdiff_t>(j) * width;
    for (int i = 0; i < width; ++i) {
      const int from = x.first + i * x.factor - x.radius();
      const Overlap taps = overlap(from, x.weights.size(), fine_size_[0]);
      float sum = 0.0f;
      for (int k = taps.begin; k < taps.end; ++k)
        sum += x.weights[static_cast<std::size_t>(k)] * static_cast<float>(row[from + k]);
      to[i] = sum;
    }
  }
  const Axis& y = axes_[1];
  std::ranges::fill(blurred, 0.0f);
  for (int j = 0; j < grid_.size[1]; ++j) {
    float* to = blurred.data() + static_cast<std::ptrdiff_t>(j) * width;
    const int from = y.first + j * y.factor - y.radius();
    const Overlap taps = overlap(from, y.weights.size(), fine_size_[1]);
    for (int k = taps.begin; k < taps.end; ++k) {
      const float weight = y.weights[static_cast<std::size_t>(k)];
      const float* row = along_rows.data() + static_cast<std::ptrdiff_t>(from + k) * width;
      for (int i = 0; i < width; ++i) to[i] += weight * row[i];
    }
  }
}

void VolumeBlur::fill(const AttenuationVolume& from, std::span<std::uint16_t> voxels) const {
  check(from.grid().size == fine_size_, "the volume that the blur was made for");
  check(voxels.size() == grid_.voxel_count(), "one voxel per grid point");
  const Axis& z = axes_[2];
  const std::size_t area =
      static_cast<std::size_t>(grid_.size[0]) * static_cast<std::size_t>(grid_.size[1]);
  const std::size_t fine_area =
      static_cast<std::size_t>(fine_size_[0]) * static_cast<std::size_t>(fine_size_[1]);
  std::vector<float> along_rows(static_cast<std::size_t>(grid_.size[0]) *
                                static_cast<std::size_t>(fine_size_[1]));
  // The slices that one coarse slice needs, each at its place in the rotation.
  std::vector<std::vector<float>> slices(z.weights.size(), std::vector<float>(area));
  std::vector<float> sums(area);
  int next = 0;
  for (int k = 0; k < grid_.size[2]; ++k) {
    const int first = z.first + k * z.factor - z.radius();
    const Overlap taps = overlap(first, z.weights.size(), fine_size_[2]);
    std::ranges::fill(sums, 0.0f);
    for (int tap = taps.begin; tap < taps.end; ++tap) {
      const int slice = first + tap;
      std::vector<float>& blurred = slices[static_cast<std::size_t>(slice) % slices.size()];
      for (; next <= slice; ++next)
        blur_slice(from.voxels().data() + static_cast<std::size_t>(next) * fine_area,
                   along_rows,
                   slices[static_cast<std::size_t>(next) % slices.size()]);
      const float weight = z.weights[static_cast<std::size_t>(tap)];
      for (std::size_t i = 0; i < area; ++i) sums[i] += weight * blurred[i];
    }
    std::uint16_t* to = voxels.data() + static_cast<std::size_t>(k) * area;
    for (std::size_t i = 0; i < area; ++i)
      to[i] = static_cast<std::uint16_t>(sums[i] + 0.5f);  // NOLINT(bugprone-incorrect-roundings)
  }
}

std::shared_ptr<const AttenuationVolume> blurred_volume(const AttenuationVolume& volume,
                                                        double sigma_mm) {
  const VolumeBlur blur(volume.grid(), sigma_mm);
  std::vector<std::uint16_t> voxels(blur.grid().voxel_count());
  blur.fill(volume, voxels);
  return std::make_shared<const AttenuationVolume>(
      blur.grid(), volume.model(), SharedArray<std::uint16_t>(std::move(voxels)));
}

}  // namespace af
