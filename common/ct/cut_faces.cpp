// SPDX-License-Identifier: Apache-2.0
#include "ct/cut_faces.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace af {
namespace {

/// An outermost layer is compared with the layer this far inside. The distance is less than the
/// radius of the ends of bones, and more than the partial volume of their surfaces.
constexpr double kInsideMm = 2.0;

/// Enough to cover the projection of a cut of 100 mm with points 2 mm apart.
constexpr std::size_t kMostPointsOfAFace = 2000;

/// The attenuating part of a CT, by voxel.
struct AttenuatingPart {
  const CtVolume& ct;
  const AttenuationModel& model;
  AttenuatingBox box;

  /// The attenuating voxels of the layer `index` across `axis`.
  [[nodiscard]] std::vector<Eigen::Vector3i> layer(std::size_t axis, int index) const {
    std::array<int, 3> first = box.low;
    std::array<int, 3> last = box.high;
    first[axis] = last[axis] = index;
    std::vector<Eigen::Vector3i> voxels;
    const auto& size = ct.grid.size;
    for (int k = first[2]; k <= last[2]; ++k)
      for (int j = first[1]; j <= last[1]; ++j)
        for (int i = first[0]; i <= last[0]; ++i) {
          const std::size_t at = (static_cast<std::size_t>(k) * static_cast<std::size_t>(size[1]) +
                                  static_cast<std::size_t>(j)) *
                                     static_cast<std::size_t>(size[0]) +
                                 static_cast<std::size_t>(i);
          if (model.relative_attenuation(ct.hu.data()[at]) > 0) voxels.emplace_back(i, j, k);
        }
    return voxels;
  }
};

/// Adds the points of one face when it is a cut.
void append_if_cut(const AttenuatingPart& part,
                   std::size_t axis,
                   bool is_low,
                   std::vector<Eigen::Vector3d>& points) {
  const double spacing_mm = part.ct.grid.spacing_mm[static_cast<Eigen::Index>(axis)];
  const int depth = std::max(1, static_cast<int>(std::lround(kInsideMm / spacing_mm)));
  const int outermost = is_low ? part.box.low[axis] : part.box.high[axis];
  const int inside = is_low ? outermost + depth : outermost - depth;
  if (inside < part.box.low[axis] || inside > part.box.high[axis]) return;
  const std::vector<Eigen::Vector3i> face = part.layer(axis, outermost);
  if (2 * face.size() <= part.layer(axis, inside).size()) return;
  const std::size_t stride = face.size() / kMostPointsOfAFace + 1;
  for (std::size_t i = 0; i < face.size(); i += stride)
    points.push_back(part.ct.grid.point_mm(face[i].cast<double>()));
}

}  // namespace

std::vector<Eigen::Vector3d> cut_points(const CtVolume& ct,
                                        const AttenuationModel& model,
                                        const AttenuatingBox& box) {
  const AttenuatingPart part{ct, model, box};
  std::vector<Eigen::Vector3d> points;
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (const bool is_low : {true, false}) append_if_cut(part, axis, is_low, points);
  return points;
}

}  // namespace af
