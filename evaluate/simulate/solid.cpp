// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/solid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>

#include "base/error.h"
#include "base/hash_random.h"
#include "evaluate/simulate/parallel_rows.h"
#include "evaluate/simulate/solid_chords.h"

namespace af {

namespace {

constexpr std::int16_t kAirHu = -1000;

/// Convex bodies whose chords decide for most points of a row whether they lie in a body.
struct RowFinder {
  explicit RowFinder(const Solid& solid) : wide(solid) {
    constexpr double kShare = 1e-6;  // far above rounding
    const bool is_convex = solid.shape != Solid::Shape::HalfEllipsoid && solid.waist == 0.0;
    if (solid.shape == Solid::Shape::HalfEllipsoid) wide.shape = Solid::Shape::Ellipsoid;
    wide.waist = 0.0;
    if (is_convex) sure = wide;
    wide.half_sizes_mm *= 1.0 + kShare;
    if (sure) sure->half_sizes_mm *= 1.0 - kShare;
  }

  Solid wide;                 ///< holds the body
  std::optional<Solid> sure;  ///< within the body
};

/// The sample points whose mean is one slice of voxels.
struct SliceSamples {
  Eigen::Vector3d first_point;
  Eigen::Vector3d step_mm;
  std::array<int, 3> count;
  std::vector<std::int16_t> hu;

  SliceSamples(const CtGrid& grid, int slice, int samples_per_axis)
      : step_mm(grid.spacing_mm / samples_per_axis),
        count{grid.size[0] * samples_per_axis, grid.size[1] * samples_per_axis, samples_per_axis} {
    const Eigen::Vector3d voxel_corner =
        grid.point_mm(Eigen::Vector3d(0, 0, slice)) - 0.5 * grid.spacing_mm;
    first_point = voxel_corner + 0.5 * step_mm;
    hu.assign(static_cast<std::size_t>(count[0]) * static_cast<std::size_t>(count[1]) *
                  static_cast<std::size_t>(count[2]),
              kAirHu);
  }

  [[nodiscard]] std::size_t offset(int i, int j, int k) const {
    return (static_cast<std::size_t>(k) * static_cast<std::size_t>(count[1]) +
            static_cast<std::size_t>(j)) *
               static_cast<std::size_t>(count[0]) +
           static_cast<std::size_t>(i);
  }
  /// Samples [first, last) of an axis that lie within [low, high] mm.
  [[nodiscard]] std::pair<int, int> range(int axis, double low_mm, double high_mm) const {
    const auto a = static_cast<std::size_t>(axis);
    const double limit = count[a];
    const double first = std::ceil((low_mm - first_point[axis]) / step_mm[axis]);
    const double last = std::floor((high_mm - first_point[axis]) / step_mm[axis]) + 1.0;
    return {static_cast<int>(std::clamp(first, 0.0, limit)),
            static_cast<int>(std::clamp(last, 0.0, limit))};
  }

  void paint(const Solid& solid, const CtBox& bounds) {
    const RowFinder rows(solid);
    const auto [i0, i1] = range(0, bounds.low_mm.x(), bounds.high_mm.x());
    const auto [j0, j1] = range(1, bounds.low_mm.y(), bounds.high_mm.y());
    const auto [k0, k1] = range(2, bounds.low_mm.z(), bounds.high_mm.z());
    for (int k = k0; k < k1; ++k)
      for (int j = j0; j < j1; ++j) {
        const auto point = [&](int i) {
          return Eigen::Vector3d(first_point + step_mm.cwiseProduct(Eigen::Vector3d(i, j, k)));
        };
        const Eigen::Vector3d row_start = point(0);
        const auto samples = [&](const Chord& chord, std::pair<int, int> within) {
          const auto [low, high] =
              range(0, row_start.x() + chord.first_mm, row_start.x() + chord.last_mm);
          return std::pair(std::max(low, within.first), std::min(high, within.second));
        };
        std::int16_t* row = hu.data() + offset(0, j, k);
        for (const Chord& outer : chords(rows.wide, row_start, Eigen::Vector3d::UnitX())) {
          const auto all = samples(outer, {i0, i1});
          std::pair sure(all.second, all.second);
          if (rows.sure)
            for (const Chord& inner : chords(*rows.sure, row_start, Eigen::Vector3d::UnitX()))
              sure = samples(inner, all);
          for (int i = all.first; i < all.second; ++i)
            if ((i >= sure.first && i < sure.second) || solid.contains(point(i)))
              row[i] = static_cast<std::int16_t>(solid.texture_hu == 0 ? solid.hu
                                                                       : solid.hu_at(point(i)));
        }
      }
  }

  /// Mean of the samples of voxel (column, row), rounded.
  [[nodiscard]] std::int16_t voxel_mean(int column, int row, int samples_per_axis) const {
    int sum = 0;
    for (int k = 0; k < samples_per_axis; ++k)
      for (int j = 0; j < samples_per_axis; ++j)
        for (int i = 0; i < samples_per_axis; ++i)
          sum += hu[offset(column * samples_per_axis + i, row * samples_per_axis + j, k)];
    return static_cast<std::int16_t>(nearest_hu(
        static_cast<double>(sum) / (samples_per_axis * samples_per_axis * samples_per_axis)));
  }
};

/// A value in [-1, 1] of one lattice point.
double lattice_value(std::int64_t i, std::int64_t j, std::int64_t k) {
  const std::uint64_t bits = hash64(
      static_cast<std::uint64_t>(i), static_cast<std::uint64_t>(j), static_cast<std::uint64_t>(k));
  return 2.0 * static_cast<double>(bits >> 11) * 0x1.0p-53 - 1.0;
}

/// Corners of the lattice's cells that a thread visited. It returns to them, and neighbouring rays
/// pass through the same ones.
class LatticeCells {
 public:
  LatticeCells() : cells_(kCells) {}

  const std::array<double, 8>& corners_of(const std::array<std::int64_t, 3>& at) {
    // Cells along a ray and beside it get different places.
    const auto part = [&](std::size_t axis) { return static_cast<std::uint64_t>(at[axis]); };
    Cell& cell = cells_[(part(0) + 37 * part(1) + 331 * part(2)) % kCells];
    // Compared by hand, because std::array's comparison calls std::memcmp().
    if (cell.at[0] != at[0] || cell.at[1] != at[1] || cell.at[2] != at[2]) fill(cell, at);
    return cell.corners;
  }

 private:
  struct Cell {
    std::array<std::int64_t, 3> at{
        std::numeric_limits<std::int64_t>::min()};  ///< no point has this
    std::array<double, 8> corners{};
  };
  static constexpr std::size_t kCells = 1024;  ///< 96 KiB

  static void fill(Cell& cell, const std::array<std::int64_t, 3>& at) {
    for (std::size_t corner = 0; corner < cell.corners.size(); ++corner)
      cell.corners[corner] = lattice_value(at[0] + static_cast<std::int64_t>(corner & 1U),
                                           at[1] + static_cast<std::int64_t>(corner >> 1U & 1U),
                                           at[2] + static_cast<std::int64_t>(corner >> 2U));
    cell.at = at;
  }

  std::vector<Cell> cells_;
};

/// std::floor() without a call: X-rays read millions of texture points.
std::int64_t floor_of(double x) {
  const auto whole = static_cast<std::int64_t>(x);
  return whole - static_cast<std::int64_t>(static_cast<double>(whole) > x);
}

/// std::lerp() has branches that make its ends exact; this has none.
double blend(double a, double b, double part) {
  return a + part * (b - a);
}

}  // namespace

bool Solid::contains(const Eigen::Vector3d& ct_point_mm) const {
  const Eigen::Vector3d local = rotation.transpose() * (ct_point_mm - center_mm);
  switch (shape) {
    case Shape::EllipticCylinder: {
      const Eigen::Vector3d unit = local.cwiseQuotient(half_sizes_mm);
      if (std::abs(unit.z()) > 1.0) return false;
      const double radius = 1.0 - waist * (1.0 - unit.z() * unit.z());
      return unit.head<2>().squaredNorm() <= radius * radius;
    }
    case Shape::Capsule: {
      const double along = std::clamp(local.z(), -half_sizes_mm.z(), half_sizes_mm.z());
      const Eigen::Vector3d from_axis(local.x(), local.y(), local.z() - along);
      return from_axis.squaredNorm() <= half_sizes_mm.x() * half_sizes_mm.x();
    }
    case Shape::HalfEllipsoid:
      if (local.z() < 0.0) return false;
      break;
    case Shape::Ellipsoid:
      break;
  }
  return local.cwiseQuotient(half_sizes_mm).squaredNorm() <= 1.0;
}

int Solid::hu_at(const Eigen::Vector3d& ct_point_mm) const {
  if (texture_hu == 0) return hu;
  return hu + nearest_hu(texture_hu * texture(texture_rotation * (ct_point_mm + texture_shift_mm),
                                              texture_scale_mm));
}

Eigen::Vector3d Solid::reach_mm() const {
  if (shape != Shape::Capsule) return half_sizes_mm;
  return {half_sizes_mm.x(), half_sizes_mm.x(), half_sizes_mm.z() + half_sizes_mm.x()};
}

CtBox Solid::bounds() const {
  const Eigen::Vector3d reach = rotation.cwiseAbs() * reach_mm();
  return {center_mm - reach, center_mm + reach};
}

Solid capsule_between(const Eigen::Vector3d& a,
                      const Eigen::Vector3d& b,
                      double radius_mm,
                      int hu) {
  Solid solid;
  solid.shape = Solid::Shape::Capsule;
  solid.center_mm = 0.5 * (a + b);
  solid.half_sizes_mm = {radius_mm, radius_mm, 0.5 * (b - a).norm()};
  if (a != b) solid.rotation = rotation_between(Eigen::Vector3d::UnitZ(), b - a);
  solid.hu = hu;
  return solid;
}

Solid moved(Solid solid, const RigidTransform& motion) {
  solid.center_mm = motion * solid.center_mm;
  solid.rotation = motion.linear() * solid.rotation;
  // R^T (x' - t + R s) is x + s at x' = R x + t.
  solid.texture_shift_mm = motion.linear() * solid.texture_shift_mm - motion.translation();
  solid.texture_rotation = solid.texture_rotation * motion.linear().transpose();
  return solid;
}

double texture(const Eigen::Vector3d& ct_point_mm, double scale_mm) {
  thread_local LatticeCells cells;
  const Eigen::Vector3d position = ct_point_mm / scale_mm;
  const std::array<std::int64_t, 3> cell{
      floor_of(position.x()), floor_of(position.y()), floor_of(position.z())};
  const std::array<double, 8>& corners = cells.corners_of(cell);
  const Eigen::Vector3d part = position - Eigen::Vector3d(static_cast<double>(cell[0]),
                                                          static_cast<double>(cell[1]),
                                                          static_cast<double>(cell[2]));
  const auto along_i = [&](std::size_t corner) {
    return blend(corners[corner], corners[corner + 1], part.x());
  };
  const auto along_j = [&](std::size_t corner) {
    return blend(along_i(corner), along_i(corner + 2), part.y());
  };
  return blend(along_j(0), along_j(4), part.z());
}

CtVolume sample_solids(const CtGrid& grid,
                       const std::vector<Solid>& solids,
                       int samples_per_axis,
                       int threads) {
  check(grid.direction.isIdentity(), "sample_solids() needs a grid along the ct axes");
  check(samples_per_axis >= 1 && samples_per_axis <= 8, "1 to 8 samples per axis");
  std::vector<CtBox> bounds;
  bounds.reserve(solids.size());
  for (const Solid& solid : solids) bounds.push_back(solid.bounds());
  std::vector<std::int16_t> voxels(grid.voxel_count());
  for_each_row(grid.size[2], threads, [&](int slice) {
    SliceSamples samples(grid, slice, samples_per_axis);
    for (std::size_t i = 0; i < solids.size(); ++i) samples.paint(solids[i], bounds[i]);
    std::int16_t* voxel = voxels.data() + static_cast<std::size_t>(slice) *
                                              static_cast<std::size_t>(grid.size[0]) *
                                              static_cast<std::size_t>(grid.size[1]);
    for (int row = 0; row < grid.size[1]; ++row)
      for (int column = 0; column < grid.size[0]; ++column)
        *voxel++ = samples.voxel_mean(column, row, samples_per_axis);
  });
  return {grid, SharedArray<std::int16_t>(std::move(voxels))};
}

}  // namespace af
