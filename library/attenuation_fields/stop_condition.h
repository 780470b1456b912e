// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>

#include "attenuation_fields/export.h"

namespace attenuation_fields {

/// While it lives, calls of the library by its thread ask it whether to end early: about ten times
/// a second, on this thread, and never of calls that are shorter. When it is met, they throw an
/// Error of exit code 75, and what they were to write is undefined. Reading a file asks seldom.
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
