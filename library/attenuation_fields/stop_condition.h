// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>

#include "attenuation_fields/export.h"

namespace attenuation_fields {

/// A condition for ending calls early. While it lives, calls of the library by its thread ask it
/// about ten times a second, on this thread; shorter calls never ask it. When it is met, they throw
/// an Error of exit code 75, and what they were writing is undefined. Reading a file asks seldom.
class ATTENUATION_FIELDS_API StopCondition {
 public:
  explicit StopCondition(std::function<bool()> is_met);
  ~StopCondition();
  StopCondition(const StopCondition&) = delete;
  StopCondition& operator=(const StopCondition&) = delete;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace attenuation_fields
