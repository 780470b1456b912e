// SPDX-License-Identifier: Apache-2.0
#include "attenuation_fields/stop_condition.h"

#include <utility>

#include "base/stop_condition.h"

namespace attenuation_fields {

struct StopCondition::Impl {
  af::StopCondition condition;
};

StopCondition::StopCondition(std::function<bool()> is_met)
    : impl_(new Impl{af::StopCondition(std::move(is_met))}) {}

StopCondition::~StopCondition() = default;

}  // namespace attenuation_fields
