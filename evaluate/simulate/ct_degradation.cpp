// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/ct_degradation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/error.h"
#include "base/hash_random.h"
#include "base/number_text.h"
#include "evaluate/simulate/parallel_rows.h"

namespace af {

namespace {

std::int16_t rounded_hu(double hu, int step_hu) {
  constexpr double kLowest = std::numeric_limits<std::int16_t>::min();
  constexpr double kHighest = std::numeric_limits<std::int16_t>::max();
  return static_cast<std::int16_t>(
      std::clamp(step_hu * std::round(hu / step_hu), kLowest, kHighest));
}

}  // namespace

int slices_per_group(const CtGrid& grid, double slice_mm) {
  return std::max(1, static_cast<int>(std::lround(slice_mm / grid.spacing_mm.z())));
}

CtVolume degraded_ct(const CtVolume& ct,
                     const CtDegradationOptions& options,
                     int air_below_hu,
                     std::uint64_t seed,
                     std::uint64_t key) {
  const int group = slices_per_group(ct.grid, options.slice_mm);
  CtGrid grid = ct.grid;
  grid.size[2] = ct.grid.size[2] / group;
  if (grid.size[2] < 2)
    throw InputError("degraded-ct",
                     number_text(options.slice_mm) + " mm",
                     "must leave at least two slices of this CT");
  grid.spacing_mm.z() *= group;
  grid.origin_mm = ct.grid.point_mm(Eigen::Vector3d(0.0, 0.0, 0.5 * (group - 1)));
  const std::size_t slice_voxels =
      static_cast<std::size_t>(grid.size[0]) * static_cast<std::size_t>(grid.size[1]);
  std::vector<std::int16_t> voxels(grid.voxel_count());
  for_each_row(grid.size[2], options.threads, [&](int slice) {
    const auto k = static_cast<std::size_t>(slice);
    const auto slices = static_cast<std::size_t>(group);
    for (std::size_t i = 0; i < slice_voxels; ++i) {
      double sum = 0.0;
      for (std::size_t s = 0; s < slices; ++s) sum += ct.hu[(k * slices + s) * slice_voxels + i];
      double hu = sum / group;
      const std::size_t voxel = k * slice_voxels + i;
      if (hu >= air_below_hu && options.noise_hu > 0.0)
        hu += options.noise_hu * HashRandom(seed, key, voxel).normal();
      voxels[voxel] = rounded_hu(hu, options.step_hu);
    }
  });
  return {grid, SharedArray<std::int16_t>(std::move(voxels))};
}

}  // namespace af
