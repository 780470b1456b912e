// SPDX-License-Identifier: Apache-2.0
#include "ct/attenuation_volume.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>

#include "base/error.h"

namespace af {

namespace {

std::size_t voxel_offset(const std::array<int, 3>& size, int i, int j, int k) {
  return (static_cast<std::size_t>(k) * static_cast<std::size_t>(size[1]) +
          static_cast<std::size_t>(j)) *
             static_cast<std::size_t>(size[0]) +
         static_cast<std::size_t>(i);
}

/// The indices of voxels whose centres lie within a box of the ct frame, among those between two
/// indices along each axis of the grid. None where there are none.
std::optional<AttenuatingBox> indices_within(const CtGrid& grid,
                                             const AttenuatingBox& all,
                                             const CtBox& box_ct) {
  Eigen::Array3d low = grid.index_of(box_ct.low_mm).array();
  Eigen::Array3d high = low;
  for (const Eigen::Vector3d& corner : box_ct.corner_points()) {
    low = low.min(grid.index_of(corner).array());
    high = high.max(grid.index_of(corner).array());
  }
  AttenuatingBox inside = all;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto along = static_cast<Eigen::Index>(axis);
    const double first = std::max<double>(all.low[axis], std::ceil(low[along]));
    const double last = std::min<double>(all.high[axis], std::floor(high[along]));
    if (!(first <= last)) return std::nullopt;
    inside.low[axis] = static_cast<int>(first);
    inside.high[axis] = static_cast<int>(last);
  }
  return inside;
}

VolumePart empty_part(const CtGrid& grid, const AttenuatingBox& inside) {
  VolumePart part{bordered_grid(grid, inside), {}};
  part.voxels.resize(part.grid.voxel_count());
  return part;
}

}  // namespace

void require_castable(const CtGrid& bordered_grid) {
  double voxels = 1.0;
  for (const int size : bordered_grid.size) voxels *= size;
  // The kernels address voxels by signed 32-bit offsets.
  if (voxels >= static_cast<double>(std::numeric_limits<std::int32_t>::max()))
    throw InputError("CT size",
                     std::to_string(voxels) + " voxels",
                     "the attenuating part must have fewer than 2^31 voxels");
}

void AttenuationModel::describe(Fields& field) {
  field("water_mu_per_mm",
        mu_water_per_mm,
        "Attenuation of water, 1/mm: mu = this * max(0, 1 + HU/1000)")
      .above(0.0)
      .at_most(1.0);
  field("air_below_hu",
        air_below_hu,
        "Voxels below this HU count as air: a higher cut removes more noise, but also lung")
      .within(-1000, 0);
}

std::vector<std::string> problems(const AttenuationModel& model) {
  return field_problems(model);
}

void AttenuationVolume::fill_voxels(const CtVolume& ct,
                                    const AttenuationModel& model,
                                    const CtGrid& bordered_grid,
                                    std::span<std::uint16_t> voxels) {
  check(voxels.size() == bordered_grid.voxel_count(), "one voxel per grid point");
  std::fill(voxels.begin(), voxels.end(), std::uint16_t{0});
  // Voxel (1, 1, 1) of the bordered grid is this voxel of the CT.
  const Eigen::Vector3d first =
      ct.grid.index_of(bordered_grid.point_mm(Eigen::Vector3d::Ones())).array().round();
  const Eigen::Vector3i low = first.cast<int>();
  const auto& size = bordered_grid.size;
  for (int k = 1; k < size[2] - 1; ++k)
    for (int j = 1; j < size[1] - 1; ++j) {
      const std::int16_t* from =
          ct.hu.data() + voxel_offset(ct.grid.size, low.x(), low.y() + j - 1, low.z() + k - 1);
      std::uint16_t* to = voxels.data() + voxel_offset(size, 1, j, k);
      for (int i = 0; i < size[0] - 2; ++i) to[i] = model.relative_attenuation(from[i]);
    }
}

AttenuationVolume::AttenuationVolume(const CtVolume& ct, const AttenuationModel& model)
    : grid_(bordered_grid(ct.grid, attenuating_box(ct, model))), model_(model) {
  std::vector<std::uint16_t> voxels(grid_.voxel_count());
  fill_voxels(ct, model, grid_, voxels);
  max_mu_per_mm_ = *std::max_element(voxels.begin(), voxels.end()) * model.mu_per_mm_per_unit();
  voxels_ = SharedArray<std::uint16_t>(std::move(voxels));
}

AttenuationVolume::AttenuationVolume(const CtGrid& bordered_grid,
                                     const AttenuationModel& model,
                                     SharedArray<std::uint16_t> voxels)
    : grid_(bordered_grid), model_(model), voxels_(std::move(voxels)) {
  check(voxels_.size() == grid_.voxel_count() && voxels_.size() > 0, "one voxel per grid point");
  max_mu_per_mm_ =
      *std::max_element(voxels_.view().begin(), voxels_.view().end()) * model.mu_per_mm_per_unit();
}

CtGrid AttenuationVolume::grid_without_border() const {
  CtGrid inner = grid_;
  inner.origin_mm = grid_.point_mm(Eigen::Vector3d::Ones());
  for (int& size : inner.size) size -= 2;
  return inner;
}

std::array<Eigen::Vector3d, 8> AttenuationVolume::corner_points() const {
  return corners_mm(grid_);
}

double AttenuationVolume::max_total_attenuation() const {
  const Eigen::Vector3d extent_mm = corner_points().back() - corner_points().front();
  return max_mu_per_mm_ * extent_mm.norm();
}

VolumePart part_within(const AttenuationVolume& volume, const CtBox& box_ct) {
  const auto& size = volume.grid().size;
  const auto inside =
      indices_within(volume.grid(), {{1, 1, 1}, {size[0] - 2, size[1] - 2, size[2] - 2}}, box_ct);
  if (!inside) return {};
  VolumePart part = empty_part(volume.grid(), *inside);
  const auto& [low, high] = *inside;
  for (int k = low[2]; k <= high[2]; ++k)
    for (int j = low[1]; j <= high[1]; ++j)
      std::copy_n(
          volume.voxels().data() + voxel_offset(size, low[0], j, k),
          high[0] - low[0] + 1,
          part.voxels.data() + voxel_offset(part.grid.size, 1, j - low[1] + 1, k - low[2] + 1));
  return part;
}

VolumePart part_within(const CtVolume& ct, const AttenuationModel& model, const CtBox& box_ct) {
  const auto& size = ct.grid.size;
  const auto inside =
      indices_within(ct.grid, {{0, 0, 0}, {size[0] - 1, size[1] - 1, size[2] - 1}}, box_ct);
  if (!inside) return {};
  VolumePart part = empty_part(ct.grid, *inside);
  AttenuationVolume::fill_voxels(ct, model, part.grid, part.voxels);
  return part;
}

AttenuatingBox attenuating_box(const CtVolume& ct, const AttenuationModel& model) {
  throw_if_any(problems(model));
  const auto& size = ct.grid.size;
  AttenuatingBox box{size, {-1, -1, -1}};
  for (int k = 0; k < size[2]; ++k)
    for (int j = 0; j < size[1]; ++j) {
      const std::int16_t* row =
          ct.hu.data() + (static_cast<std::size_t>(k) * static_cast<std::size_t>(size[1]) +
                          static_cast<std::size_t>(j)) *
                             static_cast<std::size_t>(size[0]);
      const auto attenuates = [&](std::int16_t hu) { return model.relative_attenuation(hu) > 0; };
      const std::int16_t* first = std::find_if(row, row + size[0], attenuates);
      if (first == row + size[0]) continue;
      int last = size[0] - 1;
      while (!attenuates(row[last])) --last;
      const std::array<int, 3> low{static_cast<int>(first - row), j, k};
      const std::array<int, 3> high{last, j, k};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        box.low[axis] = std::min(box.low[axis], low[axis]);
        box.high[axis] = std::max(box.high[axis], high[axis]);
      }
    }
  if (box.high[0] < 0)
    throw InputError("the CT is all air: no voxel reaches " + std::to_string(model.air_below_hu) +
                     " HU");
  return box;
}

CtGrid bordered_grid(const CtGrid& ct_grid, const AttenuatingBox& box) {
  CtGrid bordered = ct_grid;
  for (std::size_t axis = 0; axis < 3; ++axis)
    bordered.size[axis] = box.high[axis] - box.low[axis] + 3;
  require_castable(bordered);
  bordered.origin_mm =
      ct_grid.point_mm(Eigen::Vector3d(box.low[0] - 1, box.low[1] - 1, box.low[2] - 1));
  return bordered;
}

}  // namespace af
