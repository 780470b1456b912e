// SPDX-License-Identifier: Apache-2.0
#include "ct/cut_faces.h"

#include <array>
#include <cmath>

#include <gtest/gtest.h>

namespace af {
namespace {

constexpr int kCtSide = 24;

/// Voxels of 1 mm, -1000 HU but 500 HU where `is_bone`.
template <typename IsBone>
CtVolume ct_of(const IsBone& is_bone,
               const std::array<int, 3>& size = {kCtSide, kCtSide, kCtSide}) {
  CtVolume ct;
  ct.grid.size = size;
  ct.grid.origin_mm = {10.0, 20.0, 30.0};
  std::vector<std::int16_t> hu;
  for (int k = 0; k < size[2]; ++k)
    for (int j = 0; j < size[1]; ++j)
      for (int i = 0; i < size[0]; ++i)
        hu.push_back(static_cast<std::int16_t>(is_bone(i, j, k) ? 500 : -1000));
  ct.hu = SharedArray<std::int16_t>(std::move(hu));
  return ct;
}

std::vector<Eigen::Vector3d> cuts_of(const CtVolume& ct) {
  const AttenuationModel model;
  return cut_points(ct, model, attenuating_box(ct, model));
}

double norm_of(double i, double j, double k) {
  return std::sqrt(i * i + j * j + k * k);
}

TEST(CutFaces, AreWhereAShaftIsCutAndNotWhereABodyEnds) {
  // A ball of radius 7, out of which a shaft of radius 4 leaves the CT upwards.
  const CtVolume ct = ct_of([](int i, int j, int k) {
    return norm_of(i - 12, j - 12, k - 9) <= 7.0 || (k > 9 && norm_of(i - 12, j - 12, 0) <= 4.0);
  });
  const auto points = cuts_of(ct);
  // Gauss's circle problem: 49 lattice points lie within 4 of the origin.
  EXPECT_EQ(points.size(), 49u);
  for (const Eigen::Vector3d& point : points) {
    EXPECT_EQ(point.z(), 30.0 + 23.0);
    EXPECT_LE(norm_of(point.x() - 22.0, point.y() - 32.0, 0.0), 4.0);
  }
}

TEST(CutFaces, OfABodyWithinTheCtAreNone) {
  const CtVolume ct =
      ct_of([](int i, int j, int k) { return norm_of(i - 12, j - 12, k - 12) <= 8.0; });
  EXPECT_TRUE(cuts_of(ct).empty());
}

TEST(CutFaces, OfFewVoxelsKeepThemAll) {
  const CtVolume ct = ct_of([](int /*i*/, int /*j*/, int /*k*/) { return true; });
  EXPECT_EQ(cuts_of(ct).size(), 6u * kCtSide * kCtSide);
}

TEST(CutFaces, OfManyVoxelsKeepOneInAFew) {
  const CtVolume ct = ct_of([](int /*i*/, int /*j*/, int /*k*/) { return true; }, {60, 60, 8});
  // Two faces of 3600 voxels, of which every other is kept, and four of 480.
  EXPECT_EQ(cuts_of(ct).size(), 2u * 1800 + 4u * 480);
}

}  // namespace
}  // namespace af
