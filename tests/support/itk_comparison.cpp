// SPDX-License-Identifier: Apache-2.0
#include "support/itk_comparison.h"

#include "base/error.h"

namespace af::test {

namespace {

Triple triple_of(const Eigen::Vector3d& vector) {
  return {vector.x(), vector.y(), vector.z()};
}

void require_identity(const Eigen::Matrix3d& direction) {
  if (!direction.isApprox(Eigen::Matrix3d::Identity()))
    throw InputError("direction", "oblique", "the CT's axes must be those of the ct frame");
}

}  // namespace

CtVolume in_identity_direction(const CtVolume& ct) {
  const auto& size = ct.grid.size;
  const auto row = static_cast<std::size_t>(size[0]);
  const auto slice = row * static_cast<std::size_t>(size[1]);
  const Eigen::Matrix3d& flips = ct.grid.direction;
  require_identity(flips.cwiseAbs());
  std::vector<std::int16_t> voxels(ct.hu.size());
  std::size_t next = 0;
  for (int k = 0; k < size[2]; ++k)
    for (int j = 0; j < size[1]; ++j)
      for (int i = 0; i < size[0]; ++i) {
        const int from_i = flips(0, 0) > 0 ? i : size[0] - 1 - i;
        const int from_j = flips(1, 1) > 0 ? j : size[1] - 1 - j;
        const int from_k = flips(2, 2) > 0 ? k : size[2] - 1 - k;
        voxels[next++] =
            ct.hu[static_cast<std::size_t>(from_k) * slice +
                  static_cast<std::size_t>(from_j) * row + static_cast<std::size_t>(from_i)];
      }
  CtGrid grid = ct.grid;
  for (int axis = 0; axis < 3; ++axis)
    if (flips(axis, axis) < 0)
      grid.origin_mm[axis] -= (size[static_cast<std::size_t>(axis)] - 1) * grid.spacing_mm[axis];
  grid.direction = Eigen::Matrix3d::Identity();
  return {grid, SharedArray<std::int16_t>(std::move(voxels))};
}

std::unique_ptr<const ItkRayCaster> itk_caster_of(const AttenuationVolume& volume) {
  const CtGrid& grid = volume.grid();
  require_identity(grid.direction);
  std::vector<double> mu_per_mm;
  mu_per_mm.reserve(volume.voxels().size());
  for (const std::uint16_t voxel : volume.voxels())
    mu_per_mm.push_back(voxel * volume.model().mu_per_mm_per_unit());
  return std::make_unique<const ItkRayCaster>(
      ItkGrid{grid.size, triple_of(grid.spacing_mm), triple_of(grid.origin_mm)}, mu_per_mm);
}

ItkFan itk_fan_of(const RayFan& fan) {
  return {triple_of(fan.source_point),
          triple_of(fan.first_point),
          triple_of(fan.column_step),
          triple_of(fan.row_step),
          fan.columns,
          fan.rows};
}

}  // namespace af::test
