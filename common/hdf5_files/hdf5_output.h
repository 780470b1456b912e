// SPDX-License-Identifier: Apache-2.0
// A small HDF5 file, made in memory.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace af {

/// Paths are absolute ("/group/dataset"); groups come before what they hold. InputError when HDF5
/// fails.
class Hdf5Output {
 public:
  Hdf5Output();
  Hdf5Output(const Hdf5Output&) = delete;
  Hdf5Output& operator=(const Hdf5Output&) = delete;
  ~Hdf5Output();

  void add_group(const std::string& path);
  /// A list, as 64-bit floats.
  void add_numbers(const std::string& path, const std::vector<double>& numbers);
  /// Rows and columns, as 64-bit floats.
  void add_matrix(const std::string& path, const Eigen::MatrixXd& matrix);
  /// A scalar, as 64-bit float or as 64-bit whole number without sign.
  void add_scalar(const std::string& path, double number);
  void add_count(const std::string& path, std::size_t number);
  /// One text of variable length in a list of one, as ITK has it.
  void add_text(const std::string& path, const std::string& text);
  /// A scalar text of fixed length.
  void add_fixed_text(const std::string& path, const std::string& text);
  /// An attribute of a group: a scalar text of fixed length. "/" is the file's own.
  void add_attribute(const std::string& group, const char* name, const std::string& text);

  /// The file as it is now.
  [[nodiscard]] std::string bytes() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace af
