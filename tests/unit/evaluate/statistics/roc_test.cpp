// SPDX-License-Identifier: Apache-2.0
#include "evaluate/statistics/roc.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

namespace af::evaluation {
namespace {

TEST(RocArea, OfHandComputedCases) {
  const std::vector<double> high = {0.9, 0.8, 0.7};
  const std::vector<double> low = {0.1, 0.2};
  EXPECT_DOUBLE_EQ(roc_area(high, low), 1.0);
  EXPECT_DOUBLE_EQ(roc_area(low, high), 0.0);
  EXPECT_DOUBLE_EQ(roc_area(high, high), 0.5);
  // 0.9 and 0.8 win both, 0.7 loses one and ties one: 4.5 of 6.
  const std::vector<double> mixed = {0.7, 0.75};
  EXPECT_DOUBLE_EQ(roc_area(high, mixed), 4.5 / 6.0);
  EXPECT_TRUE(std::isnan(roc_area(high, {})));
  EXPECT_TRUE(std::isnan(roc_area({}, high)));
}

}  // namespace
}  // namespace af::evaluation
