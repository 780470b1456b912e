// SPDX-License-Identifier: Apache-2.0
#include "volume/attenuating_box.h"

#include <algorithm>
#include <string>

#include "base/error.h"

namespace af {

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
