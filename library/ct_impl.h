// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "attenuation_fields/ct.h"
#include "base/fork_aware_mutex.h"
#include "ct/attenuation_volume.h"

namespace attenuation_fields {

struct Ct::Impl {
  af::CtVolume ct;
  CtGrid grid;
  std::vector<std::string> warnings;

  /// The attenuation by a model. One that exists already is shared, for example by the casters of
  /// two cameras.
  [[nodiscard]] std::shared_ptr<const af::AttenuationVolume> attenuation(
      const af::AttenuationModel& model) const;

 private:
  mutable af::ForkAwareMutex mutex_;
  mutable std::weak_ptr<const af::AttenuationVolume> latest_;  ///< under mutex_
};

}  // namespace attenuation_fields
