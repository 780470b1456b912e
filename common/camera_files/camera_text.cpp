// SPDX-License-Identifier: Apache-2.0
#include "camera_files/camera_text.h"

#include "base/number_text.h"

namespace af {

std::string rows_text(const Eigen::MatrixXd& matrix, const std::string& between) {
  std::string text;
  for (Eigen::Index row = 0; row < matrix.rows(); ++row)
    text += numbers_text(matrix.row(row), between) + "\n";
  return text;
}

std::string numbers_text(const Eigen::MatrixXd& matrix, const std::string& between) {
  std::string text;
  for (Eigen::Index row = 0; row < matrix.rows(); ++row)
    for (Eigen::Index column = 0; column < matrix.cols(); ++column)
      text += (text.empty() ? "" : between) + number_text(matrix(row, column) + 0.0);
  return text;
}

}  // namespace af
