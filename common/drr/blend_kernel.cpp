// SPDX-License-Identifier: Apache-2.0
#include "drr/blend_kernel.h"

namespace af::AF_KERNEL_NAMESPACE {

void blend_samples(const SampleRun& run, float* blended, int32_t count) {
  const float v_weight = run.v_weight;
  const float step = run.step;
  const float* __restrict u_weights = run.u_weights;
  float* __restrict out = blended;
  for (int32_t i = 0; i < count; ++i) {
    const auto low_low = static_cast<float>(run.viewpoints[0][i]);
    const auto low_up = static_cast<float>(run.viewpoints[1][i]);
    const auto up_low = static_cast<float>(run.viewpoints[2][i]);
    const auto up_up = static_cast<float>(run.viewpoints[3][i]);
    const float low = low_low + v_weight * (low_up - low_low);
    const float up = up_low + v_weight * (up_up - up_low);
    out[i] = step * (low + u_weights[i] * (up - low));
  }
}

}  // namespace af::AF_KERNEL_NAMESPACE
