// SPDX-License-Identifier: Apache-2.0
#include "ct/body_mask.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "base/error.h"

namespace af {

namespace {

constexpr std::int16_t kNoBodyHu = -1000;
constexpr std::int16_t kTissueHu = -300;
constexpr std::int16_t kNotAirHu = -900;
constexpr std::int16_t kDenseHu = 300;
constexpr double kEdgeMm = 3.5;
constexpr double kLeastBodyShare = 0.1;  ///< of the largest part

/// Marks of a voxel while the body is looked for.
enum class Mark : std::uint8_t { Nothing, Core, Counted, Body };

/// The volume slice by slice along the axis that lies nearest the patient's.
struct AxialOrder {
  std::size_t width = 0;  ///< of a slice
  std::size_t height = 0;
  std::size_t slices = 0;
  std::size_t x_stride = 0;
  std::size_t y_stride = 0;
  std::size_t slice_stride = 0;
  double dx_mm = 1.0;
  double dy_mm = 1.0;
};

AxialOrder axial_order(const CtGrid& grid) {
  Eigen::Index axial = 2;
  grid.direction.row(2).cwiseAbs().maxCoeff(&axial);
  const std::array<std::size_t, 3> strides = {
      1,
      static_cast<std::size_t>(grid.size[0]),
      static_cast<std::size_t>(grid.size[0]) * static_cast<std::size_t>(grid.size[1])};
  const auto x = static_cast<std::size_t>(axial == 0 ? 1 : 0);
  const auto y = static_cast<std::size_t>(axial == 2 ? 1 : 2);
  const auto z = static_cast<std::size_t>(axial);
  AxialOrder order;
  order.width = static_cast<std::size_t>(grid.size[x]);
  order.height = static_cast<std::size_t>(grid.size[y]);
  order.slices = static_cast<std::size_t>(grid.size[z]);
  order.x_stride = strides[x];
  order.y_stride = strides[y];
  order.slice_stride = strides[z];
  order.dx_mm = grid.spacing_mm[static_cast<Eigen::Index>(x)];
  order.dy_mm = grid.spacing_mm[static_cast<Eigen::Index>(y)];
  return order;
}

/// The distance (mm) of each pixel of a slice to the nearest one that `is_goal` names, by steps to
/// the eight neighbours. At most 8 % too long.
class SliceDistance {
 public:
  explicit SliceDistance(const AxialOrder& order) : order_(order) {
    distance_.resize(order.width * order.height);
  }

  template <typename IsGoal>
  const std::vector<float>& from(const IsGoal& is_goal) {
    for (std::size_t y = 0; y < order_.height; ++y)
      for (std::size_t x = 0; x < order_.width; ++x)
        distance_[y * order_.width + x] = is_goal(x, y) ? 0.0f : kFar;
    const auto dx = static_cast<float>(order_.dx_mm);
    const auto dy = static_cast<float>(order_.dy_mm);
    const auto diagonal = static_cast<float>(std::hypot(order_.dx_mm, order_.dy_mm));
    const auto width = static_cast<std::ptrdiff_t>(order_.width);
    const auto height = static_cast<std::ptrdiff_t>(order_.height);
    const auto relax =
        [&](std::ptrdiff_t x, std::ptrdiff_t y, std::ptrdiff_t ox, std::ptrdiff_t oy, float step) {
          const std::ptrdiff_t nx = x + ox;
          const std::ptrdiff_t ny = y + oy;
          if (nx < 0 || ny < 0 || nx >= width || ny >= height) return;
          float& here = distance_[static_cast<std::size_t>(y * width + x)];
          here = std::min(here, distance_[static_cast<std::size_t>(ny * width + nx)] + step);
        };
    for (std::ptrdiff_t y = 0; y < height; ++y)
      for (std::ptrdiff_t x = 0; x < width; ++x) {
        relax(x, y, -1, 0, dx);
        relax(x, y, 0, -1, dy);
        relax(x, y, -1, -1, diagonal);
        relax(x, y, 1, -1, diagonal);
      }
    for (std::ptrdiff_t y = height; y-- > 0;)
      for (std::ptrdiff_t x = width; x-- > 0;) {
        relax(x, y, 1, 0, dx);
        relax(x, y, 0, 1, dy);
        relax(x, y, 1, 1, diagonal);
        relax(x, y, -1, 1, diagonal);
      }
    return distance_;
  }

 private:
  static constexpr float kFar = 1e9f;
  const AxialOrder& order_;
  std::vector<float> distance_;
};

/// Marks tissue that is farther than kEdgeMm from everything else.
void mark_core(const AxialOrder& order,
               std::span<const std::int16_t> hu,
               std::vector<Mark>& marks) {
  SliceDistance distance(order);
  for (std::size_t slice = 0; slice < order.slices; ++slice) {
    const auto at = [&](std::size_t x, std::size_t y) {
      return slice * order.slice_stride + y * order.y_stride + x * order.x_stride;
    };
    const std::vector<float>& depth =
        distance.from([&](std::size_t x, std::size_t y) { return hu[at(x, y)] <= kTissueHu; });
    for (std::size_t y = 0; y < order.height; ++y)
      for (std::size_t x = 0; x < order.width; ++x)
        if (static_cast<double>(depth[y * order.width + x]) > kEdgeMm) marks[at(x, y)] = Mark::Core;
  }
}

/// Gives another mark to all voxels connected with `seed` (6 neighbours, same mark). Returns how
/// many there are.
std::size_t mark_part(const CtGrid& grid, std::size_t seed, Mark mark, std::vector<Mark>& marks) {
  const Mark wanted = marks[seed];
  const auto nx = static_cast<std::size_t>(grid.size[0]);
  const std::size_t nxy = nx * static_cast<std::size_t>(grid.size[1]);
  std::vector<std::size_t> open = {seed};
  marks[seed] = mark;
  std::size_t count = 0;
  while (!open.empty()) {
    const std::size_t at = open.back();
    open.pop_back();
    ++count;
    const auto visit = [&](bool exists, std::size_t other) {
      if (!exists || marks[other] != wanted) return;
      marks[other] = mark;
      open.push_back(other);
    };
    visit(at % nx > 0, at - 1);
    visit(at % nx + 1 < nx, at + 1);
    visit(at % nxy >= nx, at - nx);
    visit(at % nxy + nx < nxy, at + nx);
    visit(at >= nxy, at - nxy);
    visit(at + nxy < marks.size(), at + nxy);
  }
  return count;
}

/// Marks the largest parts of the core as the body. Returns how many there are.
std::size_t mark_body(const CtGrid& grid, std::vector<Mark>& marks) {
  struct Part {
    std::size_t seed;
    std::size_t voxels;
  };
  std::vector<Part> parts;
  std::size_t most = 0;
  for (std::size_t at = 0; at < marks.size(); ++at)
    if (marks[at] == Mark::Core) {
      parts.push_back({at, mark_part(grid, at, Mark::Counted, marks)});
      most = std::max(most, parts.back().voxels);
    }
  std::size_t kept = 0;
  for (const Part& part : parts)
    if (static_cast<double>(part.voxels) >= kLeastBodyShare * static_cast<double>(most)) {
      (void)mark_part(grid, part.seed, Mark::Body, marks);
      ++kept;
    }
  return kept;
}

/// Within a slice, gives the edges back and fills what the body encloses.
class SliceBody {
 public:
  explicit SliceBody(const AxialOrder& order)
      : order_(order), distance_(order), is_outside_(order.width * order.height) {}

  /// 1 for every pixel of slice `slice` outside the body.
  const std::vector<std::uint8_t>& outside(std::size_t slice, const std::vector<Mark>& marks) {
    const auto at = [&](std::size_t x, std::size_t y) {
      return slice * order_.slice_stride + y * order_.y_stride + x * order_.x_stride;
    };
    const std::vector<float>& away =
        distance_.from([&](std::size_t x, std::size_t y) { return marks[at(x, y)] == Mark::Body; });
    std::fill(is_outside_.begin(), is_outside_.end(), std::uint8_t{0});
    const auto is_body = [&](std::size_t pixel) {
      // This is one step more than was taken off: distances are between pixel centres, and the
      // voxels along the skin are partly tissue.
      const double reach = kEdgeMm + std::max(order_.dx_mm, order_.dy_mm);
      return static_cast<double>(away[pixel]) <= reach;
    };
    std::vector<std::size_t> open;
    const auto visit = [&](std::size_t pixel) {
      if (is_outside_[pixel] != 0 || is_body(pixel)) return;
      is_outside_[pixel] = 1;
      open.push_back(pixel);
    };
    for (std::size_t x = 0; x < order_.width; ++x) {
      visit(x);
      visit((order_.height - 1) * order_.width + x);
    }
    for (std::size_t y = 0; y < order_.height; ++y) {
      visit(y * order_.width);
      visit(y * order_.width + order_.width - 1);
    }
    while (!open.empty()) {
      const std::size_t pixel = open.back();
      open.pop_back();
      const std::size_t x = pixel % order_.width;
      if (x > 0) visit(pixel - 1);
      if (x + 1 < order_.width) visit(pixel + 1);
      if (pixel >= order_.width) visit(pixel - order_.width);
      if (pixel + order_.width < is_outside_.size()) visit(pixel + order_.width);
    }
    return is_outside_;
  }

 private:
  const AxialOrder& order_;
  SliceDistance distance_;
  std::vector<std::uint8_t> is_outside_;
};

}  // namespace

BodyRemoval remove_all_but_body(const CtGrid& grid, std::span<std::int16_t> hu) {
  check(hu.size() == grid.voxel_count(), "a CT has a value per voxel");
  const AxialOrder order = axial_order(grid);
  std::vector<Mark> marks(hu.size(), Mark::Nothing);
  mark_core(order, hu, marks);
  BodyRemoval removal;
  removal.parts_kept = mark_body(grid, marks);
  if (removal.parts_kept == 0)
    throw InputError("body_only",
                     "true",
                     "nothing is thicker than 7 mm and above -300 HU: there is no body to keep");
  const auto dense =
      std::count_if(hu.begin(), hu.end(), [](std::int16_t v) { return v >= kDenseHu; });
  std::size_t dense_removed = 0;
  SliceBody body(order);
  for (std::size_t slice = 0; slice < order.slices; ++slice) {
    const std::vector<std::uint8_t>& outside = body.outside(slice, marks);
    for (std::size_t pixel = 0; pixel < outside.size(); ++pixel) {
      if (outside[pixel] == 0) continue;
      std::int16_t& value = hu[slice * order.slice_stride + pixel / order.width * order.y_stride +
                               pixel % order.width * order.x_stride];
      removal.voxels_removed += value >= kNotAirHu ? 1 : 0;
      dense_removed += value >= kDenseHu ? 1 : 0;
      value = kNoBodyHu;
    }
  }
  if (dense > 0)
    removal.dense_share_removed = static_cast<double>(dense_removed) / static_cast<double>(dense);
  removal.removed_ml =
      static_cast<double>(removal.voxels_removed) * grid.spacing_mm.prod() / 1000.0;
  return removal;
}

}  // namespace af
