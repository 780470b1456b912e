// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

namespace af {

/// A value of OpenCV's FileStorage, or of the plain YAML that ROS writes: text, or numbers with
/// their rows and columns.
struct YamlValue {
  std::size_t line = 0;
  std::string text;         ///< of a scalar
  Eigen::MatrixXd numbers;  ///< of a matrix or a list (one row); empty for text
};

/// The top-level entries of a FileStorage YAML text: scalars, lists (in brackets or with a dash
/// before each item, nested or not: one row of all numbers) and matrices (rows, cols, data).
/// Entries of other forms are left out. FileError "FILE:LINE: ..." when a matrix is broken: cut
/// short, with rows, columns and numbers that do not fit.
std::map<std::string, YamlValue> parse_opencv_yaml(std::string_view text, const std::string& file);

}  // namespace af
