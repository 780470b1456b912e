// SPDX-License-Identifier: Apache-2.0
// Matrices as text for the writers of text formats; the numbers read back to the same bits.
#pragma once

#include <string>

#include <Eigen/Core>

namespace af {

/// Rows on lines of their own, numbers with `between` between them.
std::string rows_text(const Eigen::MatrixXd& matrix, const std::string& between);

/// All numbers, row by row, on one line.
std::string numbers_text(const Eigen::MatrixXd& matrix, const std::string& between);

}  // namespace af
