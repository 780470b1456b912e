// SPDX-License-Identifier: Apache-2.0
#include "xray/bilinear.h"

#include <vector>

#include <gtest/gtest.h>

namespace af {
namespace {

TEST(Bilinear, IsExactForAPlaneAndTakesTheNearestPixelBeyondTheEdge) {
  Image2d plane(4, 3);
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column)
      plane.at(column, row) = static_cast<float>(10 * column + row);
  const std::vector<double> columns = {-2.0, 0.0, 0.25, 2.5, 3.0, 9.0};
  const std::vector<double> rows = {-0.5, 1.75, 2.0};
  const Image2d found = resampled_bilinearly(plane, columns, rows);
  ASSERT_EQ(found.width, 6);
  ASSERT_EQ(found.height, 3);
  const std::vector<double> column_values = {0.0, 0.0, 2.5, 25.0, 30.0, 30.0};
  const std::vector<double> row_values = {0.0, 1.75, 2.0};
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 6; ++column)
      EXPECT_EQ(found.at(column, row),
                static_cast<float>(column_values[static_cast<std::size_t>(column)] +
                                   row_values[static_cast<std::size_t>(row)]));
}

TEST(Bilinear, OfOnePixelIsThatPixelEverywhere) {
  Image2d one(1, 1);
  one.at(0, 0) = 7.0f;
  const std::vector<double> places = {-1.0, 0.0, 1.0};
  for (const float value : resampled_bilinearly(one, places, places).pixels) EXPECT_EQ(value, 7.0f);
}

}  // namespace
}  // namespace af
