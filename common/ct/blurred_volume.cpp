// SPDX-License-Identifier: Apache-2.0
#include "ct/blurred_volume.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>
#include <utility>

#include "base/error.h"
#include "base/vector_width.h"
#include "ct/blurred_volume_kernel.h"

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
  constexpr double kLeastWeight = 1e-6;
  while (weights.size() > 1 && weights.front() < kLeastWeight)
    weights = {weights.begin() + 1, weights.end() - 1};
  const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
  std::vector<float> normalised;
  for (const double weight : weights) normalised.push_back(static_cast<float>(weight / sum));
  return normalised;
}

/// The taps along an axis whose values lie `stride` apart, for a coarse voxel whose first weight
/// stands at fine index `first` of `count`. Only those within the volume.
class AxisTaps {
 public:
  AxisTaps(std::span<const float> weights, int first, int count, std::int64_t stride) {
    const int begin = std::max(0, -first);
    const int end = std::max(begin, std::min(static_cast<int>(weights.size()), count - first));
    for (int k = begin; k < end; ++k) offsets_.push_back((first + k) * stride);
    weights_ = weights.data() + begin;
  }

  [[nodiscard]] WeightedTaps taps() const {
    return {offsets_.data(), weights_, static_cast<std::int32_t>(offsets_.size())};
  }

 private:
  std::vector<std::int64_t> offsets_;
  const float* weights_;
};

/// Blurs rows and keeps every factor-th value. Values that lie `factor` apart are first laid side
/// by side, so that sums over neighbours are sums over vectors.
class RowBlur {
 public:
  /// `first`: fine index of the first weight of the first coarse value.
  RowBlur(std::span<const float> weights, int factor, int first, int fine, int coarse)
      : weights_(weights),
        factor_(factor),
        begin_(-first),
        fine_(fine),
        coarse_(coarse),
        phase_length_(coarse + static_cast<int>(weights.size()) / factor + 1),
        phases_(static_cast<std::size_t>(factor) * static_cast<std::size_t>(phase_length_)) {
    for (std::int64_t k = 0; k < std::ssize(weights); ++k)
      offsets_.push_back(k % factor * phase_length_ + k / factor);
  }

  void operator()(const float* row, float* blurred) {
    // Fine value i stands begin_ + i places after the first weight. What lies outside stays 0.
    for (int i = 0; i < std::min(factor_, fine_); ++i) {
      const int place = begin_ + i;
      float* phase = phases_.data() + place % factor_ * phase_length_ + place / factor_;
      for (int j = i; j < fine_; j += factor_) *phase++ = row[j];
    }
    select_kernel<SumWeightedValues>(kernels_128::sum_weighted_values,
                                     kernels_256::sum_weighted_values,
                                     kernels_512::sum_weighted_values)(
        phases_.data(),
        {offsets_.data(), weights_.data(), static_cast<std::int32_t>(offsets_.size())},
        coarse_,
        blurred);
  }

 private:
  std::span<const float> weights_;
  int factor_;
  int begin_;
  int fine_;
  int coarse_;
  int phase_length_;
  std::vector<float> phases_;
  std::vector<std::int64_t> offsets_;
};

}  // namespace

VolumeBlur::Axis VolumeBlur::make_axis(double spacing_mm, double sigma_mm, double already_mm) {
  const double added = (sigma_mm * sigma_mm - already_mm * already_mm) / (spacing_mm * spacing_mm);
  const auto interpolation = [](int factor) { return (factor * factor - 1) / 6.0; };
  Axis axis;
  axis.factor = std::max(1, static_cast<int>(0.5 * sigma_mm / spacing_mm));
  while (interpolation(axis.factor) > added) --axis.factor;
  axis.weights = weights_of_variance(added - interpolation(axis.factor));
  // The outermost voxels of the fine volume are 0, and so is the first voxel of the coarse one.
  axis.first = -axis.radius();
  return axis;
}

VolumeBlur::VolumeBlur(const CtGrid& fine, double sigma_mm, double already_mm)
    : fine_size_(fine.size), grid_(fine) {
  check(sigma_mm > already_mm && already_mm >= 0.0, "a blur needs a positive sigma");
  Eigen::Vector3d first;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    axes_[i] = make_axis(fine.spacing_mm[at], sigma_mm, already_mm);
    const Axis& axis = axes_[i];
    first[at] = axis.first;
    grid_.spacing_mm[at] = axis.factor * fine.spacing_mm[at];
    const int reach = fine.size[i] - 1 + 2 * axis.radius();
    grid_.size[i] = (reach + axis.factor - 1) / axis.factor + 1;
  }
  grid_.origin_mm = fine.point_mm(first);
  require_castable(grid_);
}

void VolumeBlur::fill(const AttenuationVolume& from, std::span<std::uint16_t> voxels) const {
  check(from.grid().size == fine_size_, "the volume that the blur was made for");
  check(voxels.size() == grid_.voxel_count(), "one voxel per grid point");
  const auto sum_weighted_voxels =
      select_kernel<SumWeightedVoxels>(kernels_128::sum_weighted_voxels,
                                       kernels_256::sum_weighted_voxels,
                                       kernels_512::sum_weighted_voxels);
  const auto sum_weighted_values =
      select_kernel<SumWeightedValues>(kernels_128::sum_weighted_values,
                                       kernels_256::sum_weighted_values,
                                       kernels_512::sum_weighted_values);
  const Axis& x = axes_[0];
  const Axis& y = axes_[1];
  const Axis& z = axes_[2];
  const std::int64_t fine_width = fine_size_[0];
  const std::int64_t fine_area = fine_width * fine_size_[1];
  std::vector<AxisTaps> rows_taps;
  for (int j = 0; j < grid_.size[1]; ++j)
    rows_taps.emplace_back(y.weights, y.first_of(j), fine_size_[1], fine_width);
  RowBlur blur_row(x.weights, x.factor, x.first_of(0), fine_size_[0], grid_.size[0]);
  std::vector<float> slice(static_cast<std::size_t>(fine_area));
  std::vector<float> row(static_cast<std::size_t>(fine_width));
  std::vector<float> blurred(static_cast<std::size_t>(grid_.size[0]));
  std::uint16_t* to = voxels.data();
  for (int k = 0; k < grid_.size[2]; ++k) {
    const AxisTaps slice_taps(z.weights, z.first_of(k), fine_size_[2], fine_area);
    sum_weighted_voxels(from.voxels().data(), slice_taps.taps(), fine_area, slice.data());
    for (int j = 0; j < grid_.size[1]; ++j, to += grid_.size[0]) {
      sum_weighted_values(
          slice.data(), rows_taps[static_cast<std::size_t>(j)].taps(), fine_width, row.data());
      blur_row(row.data(), blurred.data());
      for (std::size_t i = 0; i < blurred.size(); ++i)
        to[i] =
            static_cast<std::uint16_t>(blurred[i] + 0.5f);  // NOLINT(bugprone-incorrect-roundings)
    }
  }
}

std::shared_ptr<const AttenuationVolume> blurred_volume(const AttenuationVolume& volume,
                                                        double sigma_mm,
                                                        double already_mm) {
  const VolumeBlur blur(volume.grid(), sigma_mm, already_mm);
  std::vector<std::uint16_t> voxels(blur.grid().voxel_count());
  blur.fill(volume, voxels);
  return std::make_shared<const AttenuationVolume>(
      blur.grid(), volume.model(), SharedArray<std::uint16_t>(std::move(voxels)));
}

}  // namespace af
