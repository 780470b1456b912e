// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "base/described_fields.h"

namespace af::registration {

/// Which camera's field is where, as typed.
struct FieldPaths {
  std::vector<std::string> texts;  ///< each as CAMERA=PATH

  void describe(Fields& field);
  /// Only for valid texts.
  [[nodiscard]] std::map<std::string, std::filesystem::path> by_camera() const;
};

/// Texts of another form, and cameras that are given twice.
std::vector<std::string> problems(const FieldPaths& fields);

}  // namespace af::registration
