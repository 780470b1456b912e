// SPDX-License-Identifier: Apache-2.0
#include "ct/body_mask.h"

#include <cmath>
#include <functional>

#include <gtest/gtest.h>

#include "base/error.h"

namespace af {
namespace {

CtGrid grid_of(const std::array<int, 3>& size) {
  CtGrid grid;
  grid.size = size;
  grid.spacing_mm = {1.0, 1.2, 2.0};
  return grid;
}

std::vector<std::int16_t> filled(const CtGrid& grid,
                                 const std::function<int(const Eigen::Vector3d&)>& hu_at) {
  std::vector<std::int16_t> hu;
  for (int k = 0; k < grid.size[2]; ++k)
    for (int j = 0; j < grid.size[1]; ++j)
      for (int i = 0; i < grid.size[0]; ++i)
        hu.push_back(static_cast<std::int16_t>(hu_at(grid.point_mm(Eigen::Vector3d(i, j, k)))));
  return hu;
}

// A chest of radius 35 mm with two lungs, on a table of two 2 mm shells that it touches.
bool is_chest(const Eigen::Vector3d& p) {
  return std::hypot(p.x() - 50.0, p.y() - 45.0) < 35.0;
}
bool is_lung(const Eigen::Vector3d& p) {
  return std::hypot(std::abs(p.x() - 50.0) - 14.0, p.y() - 45.0) < 10.0;
}
bool is_table(const Eigen::Vector3d& p) {
  return (p.y() >= 80.0 && p.y() < 82.0) || (p.y() >= 95.0 && p.y() < 97.0);
}
int chest_on_table_hu(const Eigen::Vector3d& p) {
  if (is_lung(p)) return -850;
  if (is_chest(p)) return 40;
  return is_table(p) ? 100 : -1000;
}

TEST(BodyMask, RemovesATableThatTheBodyTouchesAndKeepsLungs) {
  const CtGrid grid = grid_of({100, 90, 12});
  std::vector<std::int16_t> hu = filled(grid, chest_on_table_hu);
  const std::vector<std::int16_t> before = hu;
  const BodyRemoval removal = remove_all_but_body(grid, hu);
  EXPECT_EQ(removal.parts_kept, 1u);
  EXPECT_GT(removal.removed_ml, 0.0);
  std::size_t left = 0;
  for (std::size_t at = 0; at < hu.size(); ++at) {
    const auto i = static_cast<int>(at % 100);
    const auto j = static_cast<int>(at / 100 % 90);
    const Eigen::Vector3d point = grid.point_mm(Eigen::Vector3d(i, j, 0));
    if (is_chest(point)) {
      ASSERT_EQ(hu[at], before[at]) << i << ' ' << j;
    } else if (is_table(point)) {
      left += hu[at] > -1000 ? 1u : 0u;
    }
  }
  // The mask gives back 3.5 mm around the body. Where the shell touches, this keeps a lens of about
  // 24 mm.
  EXPECT_LT(left, 12u * 2u * 40u) << "of " << 12 * 2 * 2 * 100;
}

TEST(BodyMask, KeepsArmsBesideTheBodyAndDropsACable) {
  const CtGrid grid = grid_of({100, 60, 10});
  const auto arm = [](const Eigen::Vector3d& p) {
    return std::hypot(p.x() - 85.0, p.y() - 36.0) < 12.0;
  };
  const auto cable = [](const Eigen::Vector3d& p) {
    return std::hypot(p.x() - 5.0, p.y() - 10.0) < 3.0;
  };
  std::vector<std::int16_t> hu = filled(grid, [&](const Eigen::Vector3d& p) {
    const bool body = std::hypot(p.x() - 40.0, p.y() - 36.0) < 25.0;
    return body || arm(p) || cable(p) ? 50 : -1000;
  });
  const BodyRemoval removal = remove_all_but_body(grid, hu);
  EXPECT_EQ(removal.parts_kept, 2u);
  EXPECT_EQ(hu[30 * 100 + 85], 50) << "an arm";
  EXPECT_EQ(hu[8 * 100 + 5], -1000) << "a cable";
}

TEST(BodyMask, TakesSlicesAcrossThePatientsAxisWhereverThatIs) {
  CtGrid grid = grid_of({100, 90, 12});
  const std::vector<std::int16_t> upright = filled(grid, chest_on_table_hu);
  std::vector<std::int16_t> expected = upright;
  (void)remove_all_but_body(grid, expected);
  // The same volume, stored with the patient's axis first.
  CtGrid turned = grid;
  turned.size = {12, 100, 90};
  turned.spacing_mm = {2.0, 1.0, 1.2};
  turned.direction << 0, 1, 0, 0, 0, 1, 1, 0, 0;
  std::vector<std::int16_t> hu(upright.size());
  const auto at = [](int i, int j, int k) {
    return static_cast<std::size_t>(k + 12 * (i + 100 * j));
  };
  for (int k = 0; k < 12; ++k)
    for (int j = 0; j < 90; ++j)
      for (int i = 0; i < 100; ++i)
        hu[at(i, j, k)] = upright[static_cast<std::size_t>(i + 100 * (j + 90 * k))];
  (void)remove_all_but_body(turned, hu);
  for (int k = 0; k < 12; ++k)
    for (int j = 0; j < 90; ++j)
      for (int i = 0; i < 100; ++i)
        ASSERT_EQ(hu[at(i, j, k)], expected[static_cast<std::size_t>(i + 100 * (j + 90 * k))]);
}

TEST(BodyMask, SaysHowMuchBoneItTookOfAHollowBody) {
  const CtGrid grid = grid_of({100, 90, 12});
  std::vector<std::int16_t> hu = filled(grid, [](const Eigen::Vector3d& p) {
    const double radius = std::hypot(p.x() - 50.0, p.y() - 45.0);
    if (radius < 30.0) return radius > 26.0 ? 900 : -1000;  // a dry skull of 4 mm
    return std::hypot(p.x() - 10.0, p.y() - 10.0) < 8.0 ? 100 : -1000;
  });
  EXPECT_EQ(remove_all_but_body(grid, hu).dense_share_removed, 1.0);
  hu = filled(grid, chest_on_table_hu);
  EXPECT_EQ(remove_all_but_body(grid, hu).dense_share_removed, 0.0);
}

TEST(BodyMask, RefusesACtWithoutABody) {
  const CtGrid grid = grid_of({20, 20, 4});
  std::vector<std::int16_t> hu(grid.voxel_count(), -1000);
  EXPECT_THROW((void)remove_all_but_body(grid, hu), InputError);
}

}  // namespace
}  // namespace af
