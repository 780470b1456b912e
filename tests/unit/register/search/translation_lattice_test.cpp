// SPDX-License-Identifier: Apache-2.0
#include "register/search/translation_lattice.h"

#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace af::registration {
namespace {

using ::testing::ElementsAre;

/// 5 x 3 x 1 nodes, 2 mm apart.
TranslationLattice small_lattice() {
  MotionRange range(0.0, 0.0);
  range.low.translation_mm = {-4.0, -2.0, 7.0};
  range.high.translation_mm = {4.0, 2.0, 7.0};
  return {range, 2.0};
}

TEST(TranslationLattice, HasItsFirstAxisFastest) {
  const TranslationLattice lattice = small_lattice();
  ASSERT_EQ(lattice.size(), 15u);
  EXPECT_EQ(lattice.translation(0), Eigen::Vector3d(-4, -2, 7));
  EXPECT_EQ(lattice.translation(6), Eigen::Vector3d(-2, 0, 7));
  EXPECT_EQ(lattice.middle(), Eigen::Vector3d(0, 0, 7));
  EXPECT_EQ(lattice.nodes(lattice.whole()).size(), lattice.size());
}

TEST(TranslationLattice, APartEndsWhereTheLatticeEnds) {
  const TranslationLattice lattice = small_lattice();
  const LatticePart part = lattice.around({3.2, -1.4, 0.0}, 2.0);
  EXPECT_THAT(part.first, ElementsAre(3, 0, 0));
  EXPECT_THAT(part.count, ElementsAre(2, 2, 1));
  EXPECT_THAT(lattice.nodes(part), ElementsAre(3, 4, 8, 9));
}

TEST(TranslationLattice, HasEndsWhereThereIsSomethingBetweenThem) {
  const Steps three(-2.0, 2.0, 2.0);
  EXPECT_TRUE(three.is_at_end(-2.0));
  EXPECT_FALSE(three.is_at_end(0.5));
  EXPECT_TRUE(three.is_at_end(2.0));
  EXPECT_FALSE(Steps(-1.0, 1.0, 2.0).is_at_end(1.0));
  EXPECT_FALSE(Steps(7.0, 7.0, 2.0).is_at_end(7.0));
}

TEST(TranslationLattice, MaximaHaveNoLargerNeighbourAlongAnAxis) {
  const LatticePart part{{0, 0, 0}, {3, 2, 2}};
  const std::vector<float> values{5,
                                  1,
                                  4,  // the first row
                                  0,
                                  3,
                                  4,  //
                                  6,
                                  1,
                                  0,  // behind it
                                  0,
                                  0,
                                  1};  //
  EXPECT_THAT(maxima(values, part), ElementsAre(2, 4 + 1, 6));
}

}  // namespace
}  // namespace af::registration
