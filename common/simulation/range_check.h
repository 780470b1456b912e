// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace af {

/// The problems of one option struct, collected.
class RangeCheck {
 public:
  /// Notes "name = value: must be within low and high" when it is not; NaN never is.
  RangeCheck& require(const std::string& name, double value, double low, double high) {
    if (!(value >= low && value <= high))
      problems_.push_back(name + " = " + std::to_string(value) + ": must be within " +
                          std::to_string(low) + " and " + std::to_string(high));
    return *this;
  }
  void append(const std::vector<std::string>& more) {
    problems_.insert(problems_.end(), more.begin(), more.end());
  }
  void add(const std::string& problem) { problems_.push_back(problem); }
  [[nodiscard]] const std::vector<std::string>& problems() const { return problems_; }

 private:
  std::vector<std::string> problems_;
};

}  // namespace af
