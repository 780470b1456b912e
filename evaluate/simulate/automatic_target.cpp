// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/automatic_target.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "base/error.h"

namespace af {

namespace {

constexpr int kAirBelowHu = -900;
constexpr double kCellMm = 5.0;
constexpr int kMarginCells = 3;  // between box and CT: a region of interest sees a little more
constexpr double kCentralnessMm = 40.0;

std::size_t voxel_offset(const CtGrid& grid, int j, int k) {
  return (static_cast<std::size_t>(k) * static_cast<std::size_t>(grid.size[1]) +
          static_cast<std::size_t>(j)) *
         static_cast<std::size_t>(grid.size[0]);
}

/// Calls `use(index, hu)` for every voxel of at least `least_hu`.
template <typename Use>
void for_each_voxel_from(const CtVolume& ct, int least_hu, const Use& use) {
  for (int k = 0; k < ct.grid.size[2]; ++k)
    for (int j = 0; j < ct.grid.size[1]; ++j) {
      const std::int16_t* row = ct.hu.data() + voxel_offset(ct.grid, j, k);
      for (int i = 0; i < ct.grid.size[0]; ++i)
        if (row[i] >= least_hu) use(Eigen::Vector3d(i, j, k), row[i]);
    }
}

Eigen::Vector3d attenuation_centroid(const CtVolume& ct) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double weight = 0.0;
  for_each_voxel_from(ct, kAirBelowHu, [&](const Eigen::Vector3d& index, int hu) {
    sum += (1000 + hu) * index;
    weight += 1000 + hu;
  });
  if (!(weight > 0.0)) throw InputError("the CT is all air: it has no target");
  return ct.grid.point_mm(sum / weight);
}

/// The outer edges of a CT's voxels, as a box along the ct axes.
CtBox bounding_box(const CtGrid& grid) {
  const Eigen::Vector3d last(grid.size[0] - 0.5, grid.size[1] - 0.5, grid.size[2] - 0.5);
  const CtBox in_voxels{Eigen::Vector3d::Constant(-0.5), last};
  CtBox box{grid.center_mm(), grid.center_mm()};
  for (const Eigen::Vector3d& corner : in_voxels.corner_points()) {
    box.low_mm = box.low_mm.cwiseMin(grid.point_mm(corner));
    box.high_mm = box.high_mm.cwiseMax(grid.point_mm(corner));
  }
  return box;
}

/// Bone voxels counted in cells along the ct axes, as a summed volume table: entry (i, j, k) holds
/// the sum over all cells below i, j, k.
class BoneTable {
 public:
  BoneTable(const CtVolume& ct, const CtBox& bounds) : low_mm_(bounds.low_mm) {
    for (int axis = 0; axis < 3; ++axis)
      cells_[static_cast<std::size_t>(axis)] = std::max(
          1, static_cast<int>(std::ceil((bounds.high_mm[axis] - bounds.low_mm[axis]) / kCellMm)));
    sums_.assign(static_cast<std::size_t>(cells_[0] + 1) * static_cast<std::size_t>(cells_[1] + 1) *
                     static_cast<std::size_t>(cells_[2] + 1),
                 0.0);
    for_each_voxel_from(ct, kBoneHu, [&](const Eigen::Vector3d& index, int) {
      const Eigen::Vector3d cell = (ct.grid.point_mm(index) - low_mm_) / kCellMm;
      at(cell_index(cell.x(), 0) + 1, cell_index(cell.y(), 1) + 1, cell_index(cell.z(), 2) + 1) +=
          1.0;
    });
    accumulate();
  }

  [[nodiscard]] const std::array<int, 3>& cells() const { return cells_; }
  [[nodiscard]] double total() const { return at(cells_[0], cells_[1], cells_[2]); }
  [[nodiscard]] double within(const std::array<int, 3>& a, const std::array<int, 3>& b) const {
    return at(b[0], b[1], b[2]) - at(a[0], b[1], b[2]) - at(b[0], a[1], b[2]) -
           at(b[0], b[1], a[2]) + at(a[0], a[1], b[2]) + at(a[0], b[1], a[2]) +
           at(b[0], a[1], a[2]) - at(a[0], a[1], a[2]);
  }
  [[nodiscard]] Eigen::Vector3d middle_mm(const std::array<int, 3>& a,
                                          const std::array<int, 3>& b) const {
    return low_mm_ + 0.5 * kCellMm * Eigen::Vector3d(a[0] + b[0], a[1] + b[1], a[2] + b[2]);
  }

 private:
  [[nodiscard]] int cell_index(double position, std::size_t axis) const {
    return std::clamp(static_cast<int>(position), 0, cells_[axis] - 1);
  }
  [[nodiscard]] std::size_t offset(int i, int j, int k) const {
    return (static_cast<std::size_t>(k) * static_cast<std::size_t>(cells_[1] + 1) +
            static_cast<std::size_t>(j)) *
               static_cast<std::size_t>(cells_[0] + 1) +
           static_cast<std::size_t>(i);
  }
  [[nodiscard]] double& at(int i, int j, int k) { return sums_[offset(i, j, k)]; }
  [[nodiscard]] double at(int i, int j, int k) const { return sums_[offset(i, j, k)]; }
  void accumulate() {
    for (int k = 1; k <= cells_[2]; ++k)
      for (int j = 1; j <= cells_[1]; ++j)
        for (int i = 1; i <= cells_[0]; ++i)
          at(i, j, k) += at(i - 1, j, k) + at(i, j - 1, k) + at(i, j, k - 1) - at(i - 1, j - 1, k) -
                         at(i - 1, j, k - 1) - at(i, j - 1, k - 1) + at(i - 1, j - 1, k - 1);
  }

  Eigen::Vector3d low_mm_;
  std::array<int, 3> cells_{};
  std::vector<double> sums_;
};

/// Positions [first, last] of the low corner of a box of `extent` cells on an axis.
struct CellRange {
  int first;
  int last;
};

CellRange low_corner_range(int cells, int extent) {
  const int margin = std::clamp((cells - extent) / 2, 0, kMarginCells);
  return {margin, cells - extent - margin};
}

/// The centre of the best box on the lattice.
Eigen::Vector3d best_box_center(const BoneTable& bone,
                                const Eigen::Vector3d& centroid_mm,
                                double side_mm) {
  std::array<int, 3> extent{};
  std::array<CellRange, 3> range{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    extent[axis] = std::min(bone.cells()[axis], static_cast<int>(std::lround(side_mm / kCellMm)));
    range[axis] = low_corner_range(bone.cells()[axis], extent[axis]);
  }
  Eigen::Vector3d best = centroid_mm;
  double best_score = 0.0;
  for (int k = range[2].first; k <= range[2].last; ++k)
    for (int j = range[1].first; j <= range[1].last; ++j)
      for (int i = range[0].first; i <= range[0].last; ++i) {
        const std::array<int, 3> low{i, j, k};
        const std::array<int, 3> high{i + extent[0], j + extent[1], k + extent[2]};
        const Eigen::Vector3d middle = bone.middle_mm(low, high);
        const double distance = (middle - centroid_mm).norm() / kCentralnessMm;
        const double score = bone.within(low, high) * std::exp(-0.5 * distance * distance);
        if (score > best_score) {
          best_score = score;
          best = middle;
        }
      }
  return best;
}

Eigen::Vector3d bone_centroid_within(const CtVolume& ct, const CtBox& box) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double count = 0.0;
  for_each_voxel_from(ct, kBoneHu, [&](const Eigen::Vector3d& index, int) {
    const Eigen::Vector3d point = ct.grid.point_mm(index);
    if ((point.array() < box.low_mm.array()).any() || (point.array() > box.high_mm.array()).any())
      return;
    sum += point;
    count += 1.0;
  });
  if (!(count > 0.0)) return 0.5 * (box.low_mm + box.high_mm);
  return sum / count;
}

}  // namespace

RegistrationTarget target_box_at(const Eigen::Vector3d& center_ct_mm, double side_mm) {
  const Eigen::Vector3d half = Eigen::Vector3d::Constant(0.5 * side_mm);
  return {center_ct_mm, {center_ct_mm - half, center_ct_mm + half}};
}

RegistrationTarget find_target(const CtVolume& ct) {
  const Eigen::Vector3d centroid_mm = attenuation_centroid(ct);
  const CtBox bounds = bounding_box(ct.grid);
  const BoneTable bone(ct, bounds);
  Eigen::Vector3d center = centroid_mm;
  if (bone.total() > 0.0)
    center = bone_centroid_within(
        ct, target_box_at(best_box_center(bone, centroid_mm, kTargetSideMm), kTargetSideMm).box_ct);
  // Keep the box and its margin within the CT where the CT is large enough for them.
  const double reach_mm = 0.5 * kTargetSideMm + kMarginCells * kCellMm;
  for (int axis = 0; axis < 3; ++axis) {
    const double low = bounds.low_mm[axis] + reach_mm;
    const double high = bounds.high_mm[axis] - reach_mm;
    center[axis] = low <= high ? std::clamp(center[axis], low, high) : 0.5 * (low + high);
  }
  return target_box_at(center, kTargetSideMm);
}

RegionOfInterest target_region(const CameraGeometry& camera,
                               const RigidTransform& room_from_ct,
                               const RegistrationTarget& target,
                               const Eigen::Vector2i& wanted_px) {
  constexpr double kBoxMarginPx = 8.0;
  constexpr int kDetectorMarginPx = 2;
  constexpr int kSmallestSidePx = 16;
  Eigen::Array2d low = Eigen::Array2d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Array2d high = -low;
  for (const Eigen::Vector3d& corner : target.box_ct.corner_points()) {
    const Eigen::Vector3d in_room = room_from_ct * corner;
    if (!(camera.depth_mm(in_room) > 0.0))
      throw InputError("the target box lies behind the source of camera '" + camera.name + "'");
    const Eigen::Array2d pixel = camera.project(in_room).array();
    low = low.min(pixel);
    high = high.max(pixel);
  }
  const Eigen::Array2d middle = 0.5 * (low + high);
  const Eigen::Array2d side =
      (high - low + 2.0 * kBoxMarginPx).max(wanted_px.cast<double>().array());
  Eigen::Array2i first{};
  Eigen::Array2i last{};  // one past the end
  for (int axis = 0; axis < 2; ++axis) {
    const double furthest = camera.size_px[axis] - kDetectorMarginPx;
    const double begin = std::round(middle[axis] - 0.5 * side[axis] + 0.5);
    first[axis] =
        static_cast<int>(std::clamp(begin, static_cast<double>(kDetectorMarginPx), furthest));
    last[axis] = static_cast<int>(std::clamp(
        begin + std::ceil(side[axis]), static_cast<double>(kDetectorMarginPx), furthest));
    if (last[axis] - first[axis] < kSmallestSidePx)
      throw InputError("the target's projection misses the detector of camera '" + camera.name +
                       "': give --center-ct-mm, or another rig");
  }
  return {first.x(), first.y(), last.x() - first.x(), last.y() - first.y()};
}

Eigen::Vector2i default_region_size_px(const CameraGeometry& camera) {
  constexpr int kUsualSidePx = 200;
  constexpr double kLargestShare = 0.6;
  return (camera.size_px.cast<double>() * kLargestShare)
      .cast<int>()
      .cwiseMin(Eigen::Vector2i::Constant(kUsualSidePx));
}

}  // namespace af
